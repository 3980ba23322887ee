"""Follow an external force on one of the arm's links by what it changes of the motors' loads.

Ten hypotheses run side by side: nothing touches the arm, or something pushes on the centre of mass of link
1 … 9, with a force that wanders. Each link's force has a Kalman filter; a contact may begin and end at any
time, and where it begins the force is unknown. Source: Blom and Bar-Shalom, IEEE Trans. Autom. Control 33
(1988) 780 (interacting multiple models). The coloured part of the loads' errors is a state of every
hypothesis.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.estimators.coloured_noise import ColouredNoise
from serpent_twin.readouts.covariance import reach2

SIZE = 0.5
"""Standard deviation of each component of a force that begins [N]"""
WALK = 0.4
"""Standard deviation of a force component's change in a second [N]; the component's own stays `SIZE`"""
FREE, LASTS = 30.0, 15.0
"""Mean time until something touches the arm, and until it lets go [s]"""
JOLT = 3e-4
"""Probability that a row's loads err for once as a force would make them, as where a hinge slips a row sooner
than the twin's: five times in an hour of the bench arm's free motion, whose errors are white otherwise
"""
ALARM = 3600.0
"""Mean time between contacts that are none, if the loads' errors are as trained, at least [s]"""
_AXES = 3
_LEAST = 1e-30  # of a hypothesis: it can always come back
_TINY = 1e-12  # [N²]


@dataclass(frozen=True)
class FeltForce:
    """What is known of the force on the arm at an instant."""

    contact: float
    """Probability that something touches the arm"""
    touched: bool
    """Whether contact is reported: from where its odds exceed what chance shows once in `ALARM` on, until no
    contact is more probable. Their threshold is that of Shiryaev and Roberts: odds over the probability that
    a contact begins in a row, which chance takes to A in A rows on average, or later"""
    link: int
    """The most probable one, 1 … 9"""
    links: Array
    """Probability of each, if something touches the arm, (9,)"""
    force: Array
    """Force in the base frame: the mean over all hypotheses, no contact included [N], (3,)"""
    covariance: Array
    """Covariance of the error of `force` [N²], (3, 3). Where motors stand, their gears' friction bounds the
    force and tells no more: then an ellipsoid of 95 % holds all that they allow"""
    on_link: Array
    """The force if it acts on each link's centre of mass [N], (9, 3)"""
    on_link_covariance: Array
    """Covariance of the error of `on_link` [N²], (9, 3, 3)"""

    @property
    def spread(self) -> float:
        """Root mean square of the force's expected error [N]."""
        return float(np.sqrt(np.trace(self.covariance)))


@dataclass(frozen=True)
class LoadErrors:
    """Differences of the loads from a twin's at an instant, as fractions of the stall torque."""

    free: Array
    """Differences from the loads of a twin that nothing touches, (10,)"""
    pushed: Array
    """Differences from the loads at zero force on any link, extrapolated by `slope` from the expected force,
    (10,)
    """
    slope: Array
    """Change by a force on each link [1/N], (9, 10, 3)"""
    noise: Array
    """Standard deviation of the white part of the loads' error, (10,)"""
    friction: Array
    """What a standing motor's gear may take up, (10,); 0 of one that turns"""
    known: NDArray[np.bool_]
    """Whether a motor's load tells anything, (10,)"""


class ForceFilter:
    """The hypotheses of one session, row by row.

    Each has a Kalman filter of the force, and of the sources of the loads' coloured noise; that of no contact
    has a force, too, which no load shows.
    """

    def __init__(self, coloured: ColouredNoise | None = None) -> None:
        self._coloured = coloured or ColouredNoise()
        sources = self._coloured.along.shape[1]
        walk, fades = 0.5 * WALK**2 / SIZE**2, 1.0 / self._coloured.time
        self._rate = np.r_[np.full(_AXES, walk), np.full(sources, fades)]
        """Forgetting rate of each number of a state [1/s]"""
        self._prior = np.diag(np.r_[np.full(_AXES, SIZE**2), np.ones(sources)])
        self._state = np.zeros((1 + N_JOINTS, _AXES + sources))
        self._covariance = np.tile(self._prior, (1 + N_JOINTS, 1, 1))
        self._share = np.r_[1.0, np.full(N_JOINTS, _LEAST)]
        """Probabilities of no contact and of one at each link, (10,)"""
        self._touched = False

    def predict(self, interval: float) -> tuple[int, Array]:
        """Let so much time pass [s]; the most probable link, and the force that is expected on it [N], (3,),
        zero while no contact is more probable.
        """
        begins, ends = min(interval / FREE, 0.5) / N_JOINTS, min(interval / LASTS, 0.5)
        fade = np.exp(-self._rate * interval)
        self._state = fade * self._state
        faded = np.outer(fade, fade)
        self._covariance = faded * self._covariance + (1 - faded) * self._prior
        passes = np.diag(np.r_[1 - N_JOINTS * begins, np.full(N_JOINTS, 1 - ends)])
        passes[1:, 0], passes[0, 1:] = begins, ends
        flow = passes * self._share
        self._share = flow.sum(axis=1)
        self._mix(flow / self._share[:, None])
        contact = self._contact > 0.5
        return self._best + 1, self._force[self._best] * contact

    def _mix(self, share: Array) -> None:
        """Let each hypothesis go on from what it may have been before, by shares, (10, 10); where nothing
        touches the arm, of the force nothing is known.
        """
        state = share @ self._state
        apart = self._state - state[:, None]
        spread = self._covariance + apart[..., :, None] * apart[..., None, :]
        self._state, self._covariance = state, np.einsum("ij,ijxy->ixy", share, spread)
        self._state[0, :_AXES] = 0.0
        self._covariance[0, :_AXES] = self._prior[:_AXES]
        self._covariance[0, :, :_AXES] = self._prior[:, :_AXES]

    def update(self, now: LoadErrors) -> FeltForce:
        """Take up the loads' errors of a row; `predict` comes first."""
        slope = np.zeros((1 + N_JOINTS, N_MOTORS, self._state.shape[1]))
        slope[1:, :, :_AXES], slope[..., _AXES:] = now.slope, self._coloured.along
        off = np.where(np.arange(1 + N_JOINTS)[:, None] > 0, now.pushed, now.free)
        jolts, *_ = _kalman(slope[1:], self._state[:1], self._covariance[:1], now.free, now)
        likely, self._state, self._covariance = _kalman(
            slope, self._state, self._covariance, off, now
        )
        jolted = np.logaddexp.reduce(jolts) + np.log(JOLT / N_JOINTS)
        likely[0] = np.logaddexp(np.log(1 - JOLT) + likely[0], jolted)
        share = np.log(self._share) + likely
        share = np.exp(share - share.max())
        self._share = np.maximum(share / share.sum(), _LEAST)
        return self._felt(now)

    @property
    def _force(self) -> Array:
        """Force on each link [N], (9, 3)."""
        return self._state[1:, :_AXES]

    @property
    def _spread(self) -> Array:
        """Covariance of each link's force, (9, 3, 3)."""
        return self._covariance[1:, :_AXES, :_AXES]

    @property
    def _best(self) -> int:
        return int(np.argmax(self._share[1:]))

    @property
    def _contact(self) -> float:
        return float(1 - self._share[0])

    def _felt(self, now: LoadErrors) -> FeltForce:
        contact, some = self._contact, self._share[1:]
        told = some @ self._force
        odds = contact / self._share[0]
        self._touched = odds > ALARM / FREE or (self._touched and contact > 0.5)
        apart = self._force - told
        each = self._spread + apart[:, :, None] * apart[:, None, :]
        spread = np.einsum("l,lxy->xy", some, each) + self._share[0] * np.outer(told, told)
        best = self._best
        bounds = _bounds(now, now.slope[best], self._force[best])
        return FeltForce(
            contact=contact,
            touched=bool(self._touched),
            link=self._best + 1,
            links=some / some.sum(),
            force=told,
            covariance=np.linalg.inv(np.linalg.inv(spread + _TINY * np.eye(3)) + bounds),
            on_link=self._force,
            on_link_covariance=self._spread,
        )


def _kalman(
    slope: Array, state: Array, covariance: Array, off: Array, now: LoadErrors
) -> tuple[Array, Array, Array]:
    """Logarithms of how likely H hypotheses have a row's errors be, (H,), up to a number that is common to
    all, and their states and covariances after it; slopes are (H, 10, n), all else (H or 1, …).
    """
    weight, left = _beyond(off - (slope @ state[..., None])[..., 0], now)
    seen = slope * weight[..., None]
    gain = np.swapaxes(seen, 1, 2) @ slope
    pull = np.einsum("hix,hi->hx", seen, left)
    after = np.linalg.inv(np.linalg.inv(covariance) + gain)
    moved = np.einsum("hxy,hy->hx", after, pull)
    wider = np.linalg.slogdet(np.eye(slope.shape[-1]) + covariance @ gain)[1]
    likely = (weight * left**2).sum(axis=1) - (pull * moved).sum(axis=1) + wider
    return -0.5 * likely, state + moved, after


def _beyond(off: Array, now: LoadErrors) -> tuple[Array, Array]:
    """How much the loads' errors off, (…, 10), weigh, and what of them friction cannot take up."""
    left = np.sign(off) * np.maximum(np.abs(off) - now.friction, 0.0)
    tells = now.known & ((now.friction == 0) | (left != 0))
    return tells / now.noise**2, left


def _bounds(now: LoadErrors, slope: Array, force: Array) -> Array:
    """Information [1/N²], (3, 3), whose ellipsoid of 95 % holds every force that the friction of standing
    motors allows.
    """
    inside = np.abs(now.pushed - slope @ force) <= now.friction
    holding = np.flatnonzero(now.known & (now.friction > 0) & inside)
    if not holding.size:
        return np.zeros((3, 3))
    each = slope[holding] / now.friction[holding, None]
    return reach2() / len(holding) * each.T @ each
