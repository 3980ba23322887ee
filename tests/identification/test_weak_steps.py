"""Test the end of a fit along what the data tell least, where the truth is known in closed form."""

from dataclasses import dataclass, replace

import numpy as np
import posed_models
import pytest
from linear_case import GUST, LinearCase, case, every
from scipy.optimize import minimize
from serpent_twins import serpent

from serpent_twin.identification.fitting.fitted import NORMAL_95
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.machines.machine import Declared, ParameterVector
from serpent_twin.machines.model import open_machine

PRIOR, DRIVE, STIFFNESS, FORCE = 0.3, 5.0, 2.0, 3.0


@dataclass(frozen=True)
class PulledSpring(LinearCase):
    """Where a spring ends that a drive's force and a gust pull: all three times one factor move nothing.

    The declared parameters are the logarithms of the drive's gain and of the spring's stiffness.
    """

    def place(self, declared, size):
        pull = DRIVE * np.exp(declared[0]) * self.X[..., 0] + size * self.g
        return pull / (STIFFNESS * np.exp(declared[1]))

    def residual(self, points, pieces, timestep=None):
        there = [self.place(p.declared, p.effects.get(GUST, [0.0])[0]) for p in points]
        return self.weigh(self.y - np.array(there))[:, pieces]

    def coarse_step(self, points):
        return None

    def jacobian(self, point, pieces):
        return np.full((2, len(pieces), self.y.shape[1]), np.nan)


@pytest.fixture(scope="module")
def pulled():
    """A spring that was pulled by its nominal drive and by a gust."""
    of = case(0.0)
    declared = tuple(Declared(name, "log 1", PRIOR, 0.1 * PRIOR) for name in ("drive", "spring"))
    nominal = PulledSpring(of.X, of.g, of.other, of.y, declared)
    noise = 0.02 * np.random.default_rng(1).standard_normal(of.y.shape)
    y = nominal.place([0.0, 0.0], FORCE) + noise
    return PulledSpring(of.X, of.g, of.other, y, declared, noise=np.full(3, 0.02))


@dataclass(frozen=True)
class TwoServos(PulledSpring):
    """Where two servos rest against springs, the first against one that the model lacks: the declared
    parameters are the logarithms of the drives' scale and of the second's spring.
    """

    def place(self, declared, size):
        scale, spring = np.exp(declared)
        first, second = DRIVE / (DRIVE + size), DRIVE / (DRIVE + STIFFNESS * spring)
        even = np.arange(self.X.shape[1]) % 2 == 0
        return scale * np.where(even, first, second) * self.X[..., 0]


def fitted(arm, last):
    """Fit that starts where all forces are by a third too large."""
    start = ParameterVector(np.full(2, 0.3), {GUST: np.array([FORCE * np.exp(0.3)])})
    return fit(arm, every(), start, free_parameters(arm, [GUST]), 3, 99, rounds=8 * last)


def test_short_differences_tell_nothing_of_a_factor_that_all_share(pulled):
    """What long ones are off by passes for more than the priors know of it."""
    start, free = (
        ParameterVector(np.zeros(2), {GUST: np.array([FORCE])}),
        free_parameters(pulled, [GUST]),
    )
    together = np.array([1.0, 1.0, FORCE])
    told = []
    for step in (0.1, 0.001):
        declared = tuple(replace(each, step=step * PRIOR) for each in pulled.declared)
        begun = fit(replace(pulled, declared=declared), every(), start, free, 1, 99, steps=0)
        along = np.tensordot(together, begun.jacobian.astype(float), 1)
        told.append((along**2).sum() / begun.variance_inflation)
    assert told[0] > 1000 * (2 / PRIOR**2) and told[1] < 2 / PRIOR**2


def test_a_fit_goes_along_what_moves_nothing_until_its_priors_stop_it(pulled):
    """Against a general minimiser, which starts at the truth."""
    found = fitted(pulled, True)

    def cost(at):
        left = pulled.weigh(pulled.y - pulled.place(at[:2], np.exp(at[2])))
        lean = np.square(at[:2] / PRIOR).sum()
        return (left**2).sum() / found.variance_inflation + lean

    least = minimize(
        cost,
        [0.0, 0.0, np.log(FORCE)],
        method="Nelder-Mead",
        options={"xatol": 1e-6, "fatol": 1e-9},
    )
    assert found.cost == pytest.approx(least.fun, abs=0.1)
    error = PRIOR / np.sqrt(2)
    assert found.point.declared == pytest.approx(least.x[:2], abs=0.1 * error)
    assert found.point.effects[GUST][0] == pytest.approx(np.exp(least.x[2]), rel=0.1 * error)


def test_its_standard_errors_are_the_priors_there(pulled):
    """The mean of two logarithms, each known to 0.3, is known to 0.3 / √2; the force by as large a part."""
    found = fitted(pulled, True)
    error = PRIOR / np.sqrt(2)
    value, low, high = found.interval(GUST, 0)
    assert found.error[:2] == pytest.approx(error, rel=0.05)
    assert (high - low) / (2 * NORMAL_95 * value) == pytest.approx(error, rel=0.05)
    assert low < FORCE < high


def test_a_fit_follows_a_way_that_bends():
    """A scale that is too small stands for both springs, as exactly as the data are: each scale has its
    springs, in closed form, and the priors choose.
    """
    of = case(0.0)
    declared = (Declared("scale", "log 1", 0.05, 0.005), Declared("spring", "log 1", PRIOR, 0.03))
    two = TwoServos(of.X, of.g, of.other, of.y, declared)
    noise = 3e-4 * np.random.default_rng(2).standard_normal(of.y.shape)
    two = replace(two, y=two.place([0.0, 0.0], 0.8) + noise, noise=np.full(3, 3e-4))

    def springs(scale):
        first, second = (np.exp(scale) * (DRIVE + each) - DRIVE for each in (0.8, STIFFNESS))
        return first, np.log(second / STIFFNESS)

    far = -0.12
    start = ParameterVector(np.array([far, springs(far)[1]]), {GUST: np.array([springs(far)[0]])})
    found = fit(two, every(), start, free_parameters(two, [GUST]), 3, 99, rounds=8)
    assert found.point.declared == pytest.approx([0.0, 0.0], abs=0.02)
    assert found.point.effects[GUST][0] == pytest.approx(0.8, rel=0.1)


def test_without_that_it_stays_where_it_came_in(pulled):
    """What the end of a fit is for: the data tell nothing that leads on."""
    found = fitted(pulled, False)
    assert found.point.declared == pytest.approx(0.3, abs=0.02)
    assert found.cost > fitted(pulled, True).cost + 1.5


def test_arms_need_none_of_it_and_models_of_many_joints_do_little(tmp_path):
    path = posed_models.machine(tmp_path)
    rig = open_machine(path)
    few = rig.open(rig.read(posed_models.log(tmp_path / "log.csv", 0)))
    assert few.weak_rounds == 8
    hung = "".join(f'<body><joint name="j{n}"/><geom size="0.01"/>' for n in range(11))
    model = path.with_name("arm.xml")
    text = model.read_text().replace('<site name="tip"', hung + "</body>" * 11 + '<site name="tip"')
    model.write_text(text)
    many = replace(few.machine, described=open_machine(path).described)
    assert many.weak_rounds == 2
    assert serpent(range(1), 4).machine.weak_rounds == 0
