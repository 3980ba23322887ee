"""Sums over rows for changes that go on: by the adjoint and the Gramian, against what the changes show."""

import numpy as np
import pytest

from serpent_twin.identification.discovery.sums import Changes, ResidualRows, columns, shown
from serpent_twin.machines.places import LaggedResponse, RowMotion

S, T, C, D, M, W = 2, 12, 3, 8, 5, 400
RNG = np.random.default_rng(0)


def _place(adapts, components=2):
    """A place whose changes go on, and each segment's first rows, by which a start may be chosen."""
    lead = RNG.normal(0, 0.1, (S, D, 3, C)) if adapts else None
    goes_on = 0.8 * np.eye(D) + RNG.normal(0, 0.1, (S, T, D, D))
    motion = RowMotion(goes_on, RNG.normal(size=(S, T, C, D)), lead)
    enters, own = RNG.normal(size=(components, S, T, D)), RNG.normal(size=(components, S, T, C))
    return LaggedResponse("joint_torque", "joint1", motion, enters, own)


def _rows(motion, scale):
    """Rows of a residual that hold nothing that starts may change, if these are free."""
    free = columns(motion.of_starts(), scale) if motion.adapts is not None else None
    several = RNG.normal(size=(M + 1, S, T, C)) * (scale > 0)
    if free is not None:
        flat = several.reshape(M + 1, S, 1, T * C)
        several = (flat - flat @ free @ free.swapaxes(1, 2)).reshape(several.shape)
    left, *slopes = several.reshape(M + 1, S * T, C)
    return ResidualRows(left, np.array(slopes), scale, free)


@pytest.mark.parametrize("adapts", [False, True])
def test_products_of_changes_are_those_of_what_they_show(adapts):
    """Sums of many changes are by those of single rows, sums of few by what they show; products with each
    next change are checked as well.
    """
    place = _place(adapts)
    scale = RNG.uniform(0.5, 2.0, (S, T, C)) * (RNG.uniform(size=(S, T, C)) > 0.1)
    rows, changes = _rows(place.motion, scale), Changes(RNG.normal(size=(W, S * T)))
    found, few = (shown(rows, place).sums(each) for each in (changes, Changes(changes.rows[:3])))
    follows = changes.rows.reshape(W, S, T).astype(np.float32)
    Y = np.stack([rows.weighed(each).reshape(W, -1) for each in place.of(follows)])
    near = {"rel": 1e-3, "abs": 1e-3 * np.abs(found.raw).max()}
    assert found.raw == pytest.approx(np.einsum("awn,bwn->wab", Y, Y), **near)
    assert found.beside == pytest.approx(np.einsum("awn,bwn->wab", Y[:, :-1], Y[:, 1:]), **near)
    assert few.raw == pytest.approx(found.raw[:3], **near)
    assert few.beside == pytest.approx(found.beside[:2], **near)
    assert found.pulls == pytest.approx((Y @ rows.left.ravel()).T, rel=1e-3, abs=0.05)
    slopes = rows.slopes.reshape(M, -1).T
    assert found.taken == pytest.approx(Y @ slopes, rel=1e-3, abs=0.05)
    assert np.abs(found.taken).max() > 10
