"""The filter of an external force on loads that are linear in it, against what is known of them."""

import numpy as np
import pytest

from serpent_twin.estimators.force_filter import ALARM, FREE, SIZE, WALK, ForceFilter, LoadErrors

NOISE, PERIOD = 0.01, 0.25
KNOWN = np.arange(10) < 9


def slopes(rng):
    """A force on link n turns motors 1 … n, as it turns joints 1 … n."""
    slope = rng.normal(0.0, 0.05, (9, 10, 3))
    return slope * (np.arange(10)[None, :, None] <= np.arange(9)[:, None, None])


def followed(rows, link, force, rng, friction=0.0, noise=NOISE):
    """What the filter says of rows in which a force (T, 3) acts on a link; slopes are drawn anew in each row,
    as poses are."""
    out, filtered = [], ForceFilter()
    for now in force[:rows]:
        filtered.predict(PERIOD)
        slope = slopes(rng)
        off = slope[link - 1] @ now + noise * rng.standard_normal(10)
        none = np.full(10, friction)
        out.append(filtered.update(LoadErrors(off, off, slope, np.full(10, NOISE), none, KNOWN)))
    return out


def test_a_force_is_found_on_its_link_and_its_covariance_holds_it():
    rng, off, stated, links = np.random.default_rng(0), [], [], []
    for link in (4, 6, 9):
        force = np.repeat(rng.normal(0.0, SIZE, (6, 3)), 20, axis=0)
        felt = followed(120, link, force, rng)
        late = [n for n in range(120) if n % 20 > 5]
        off += [felt[n].force - force[n] for n in late]
        stated += [felt[n].covariance for n in late]
        links += [felt[n].link == link for n in late]
    far = np.einsum("ni,nij,nj->n", off, np.linalg.inv(stated), off)
    assert np.mean(links) > 0.95
    assert np.mean(far <= 7.81) > 0.9
    rms, said = np.sqrt(np.mean(np.square(off).sum(1))), np.sqrt(np.trace(stated, 0, 1, 2).mean())
    assert rms == pytest.approx(said, rel=0.4)


def test_of_one_link_alone_it_is_the_kalman_filter_of_a_wandering_force():
    """Once contact and link are certain."""
    rng = np.random.default_rng(1)
    force = np.tile([0.6, -0.4, 0.5], (60, 1))
    seed = np.random.default_rng(2)
    felt = followed(60, 9, force, seed)
    seed = np.random.default_rng(2)
    mean, spread = np.zeros(3), SIZE**2 * np.eye(3)
    fade = np.exp(-0.5 * WALK**2 * PERIOD / SIZE**2)
    for now in force:
        mean, spread = fade * mean, fade**2 * spread + (1 - fade**2) * SIZE**2 * np.eye(3)
        slope = slopes(seed)[8][:9]
        off = slope @ now + NOISE * seed.standard_normal(10)[:9]
        gain = spread @ slope.T @ np.linalg.inv(slope @ spread @ slope.T + NOISE**2 * np.eye(9))
        mean, spread = mean + gain @ (off - slope @ mean), spread - gain @ slope @ spread
    last = felt[-1]
    assert rng is not seed and last.links[8] > 1 - 1e-6
    assert last.on_link[8] == pytest.approx(mean, abs=1e-3)
    assert last.on_link_covariance[8] == pytest.approx(spread, rel=0.02, abs=1e-6)


@pytest.mark.slow
def test_chance_makes_a_contact_no_more_often_than_said():
    """Noise of 5 hours makes at most 5 contacts; the threshold's mean time is at least an hour."""
    rows = round(5 * ALARM / PERIOD)
    felt = followed(rows, 9, np.zeros((rows, 3)), np.random.default_rng(3))
    touched = np.array([each.touched for each in felt])
    assert (np.diff(touched.astype(int)) > 0).sum() <= 5
    assert np.mean([each.contact for each in felt]) < PERIOD / FREE * 20


def test_what_a_standing_motor_s_friction_can_take_up_tells_no_force_but_bounds_it():
    rng, force = np.random.default_rng(4), np.tile([0.3, 0.0, 0.0], (40, 1))
    felt = followed(40, 9, force, rng, friction=0.5, noise=0.0)
    assert max(each.contact for each in felt) < 0.9
    assert not any(each.touched for each in felt)
    turning = followed(40, 9, force, rng, noise=0.0)
    assert turning[-1].touched
    bounded = followed(40, 9, force, rng, friction=0.02, noise=0.0)
    assert bounded[-1].spread < felt[-1].spread + 1e-9 or bounded[-1].touched


def test_a_jolt_of_one_row_is_no_contact_and_what_lasts_is_found_a_row_later():
    """The noise of 0.01 is about an eighth of the loads by the force."""
    for lasts, rows in ((1, 0), (5, 4)):
        force = np.zeros((40, 3))
        force[20 : 20 + lasts] = 0.9, -0.9, 0.9
        felt = followed(40, 8, force, np.random.default_rng(6))
        assert sum(each.touched for each in felt[20 : 20 + lasts]) == rows
        assert not any(each.touched for each in felt[:20])


def test_a_contact_ends_when_nothing_pushes_any_more():
    force = np.vstack([np.tile([0.5, 0.5, 0.0], (30, 1)), np.zeros((30, 3))])
    felt = followed(60, 8, force, np.random.default_rng(5))
    assert all(each.touched for each in felt[5:30])
    assert not any(each.touched for each in felt[40:])
    assert np.linalg.norm(felt[-1].force) < 0.02
