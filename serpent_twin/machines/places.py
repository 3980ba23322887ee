"""Hold what a machine shows, to first order, of a change at each of its places."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import ranges
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import SPRING, Law
from serpent_twin.machines.machine import ParameterVector


@dataclass(frozen=True)
class PlaceResponse:
    """What a change of one quantity at one place does to the prediction in the same row."""

    handle: str
    """The quantity, of `effects.law.HANDLES`"""
    place: str
    """MuJoCo's name"""
    change: Array
    """Of the prediction per unit, of each component, (d, S, T, C)"""

    @property
    def channels(self) -> int:
        """How many channels it changes."""
        return int((self.change != 0).any(axis=(0, 1, 2)).sum())

    def along(self, direction: Array) -> "PlaceResponse":
        """That of a vector along a direction, (d,), as one component."""
        return replace(self, change=np.tensordot(direction, self.change, 1)[None])


@dataclass(frozen=True)
class RowMotion:
    """How small changes of D states go on from row to row, in S segments of T rows."""

    goes_on: Array
    """Changes of the next row's state, (S, T, D, D)"""
    shows: Array
    """Changes of the prediction, (S, T, C, D)"""
    adapts: Array | None = None
    """By how much the first state is chosen otherwise for a change of the prediction in the first L rows,
    (S, D, L, C)
    """

    def of_starts(self) -> Array:
        """Changes of the prediction by the state of each segment's first row, (S, D, T, C)."""
        S, T, C, D = self.shows.shape
        out, state = np.empty((S, D, T, C)), np.tile(np.eye(D), (S, 1, 1))
        for t in range(T):
            out[:, :, t] = (self.shows[:, t] @ state).swapaxes(1, 2)
            state = self.goes_on[:, t] @ state
        return out

    def adjoint(self, weighed: Array) -> Array:
        """Derivative of the sum of the prediction times weights, (S, T, C), by the state of the row after
        each row, (S, T, D).
        """
        S, T, _, D = self.shows.shape
        out, later = np.zeros((S, T, D)), np.zeros((S, D))
        for t in reversed(range(T)):
            out[:, t] = later
            own = np.einsum("scd,sc->sd", self.shows[:, t], weighed[:, t])
            later = np.einsum("sed,se->sd", self.goes_on[:, t], later) + own
        return out

    def driven(self, pushes: Array, own: Array) -> Array:
        """Changes of the prediction, (n, S, T, C), by pushes on the state of the row after each row,
        (n, S, T, D), and by what shows in the row itself, (n, S, T, C).
        """
        n, S, D = *pushes.shape[:2], pushes.shape[3]
        begun = np.zeros((S, n, D), np.float32)
        if self.adapts is not None:
            lead = self.adapts.shape[2]
            read = self._rows(begun, pushes[:, :, :lead], own[:, :, :lead])
            flat = read.swapaxes(0, 1).reshape(S, n, -1)
            begun = flat @ self.adapts.reshape(S, D, -1).swapaxes(1, 2).astype(np.float32)
        return self._rows(begun, pushes, own)

    def _rows(self, state: Array, pushes: Array, own: Array) -> Array:
        """The same from states of the first row, (S, n, D)."""
        out = np.empty(own.shape, np.float32)
        goes_on, shows = self.goes_on.astype(np.float32), self.shows.astype(np.float32)
        for t in range(pushes.shape[2]):
            out[:, :, t] = (state @ shows[:, t].swapaxes(1, 2)).swapaxes(0, 1) + own[:, :, t]
            state = state @ goes_on[:, t].swapaxes(1, 2) + pushes[:, :, t].swapaxes(0, 1)
        return out


@dataclass(frozen=True)
class LaggedResponse:
    """What a change of one quantity at one place does to the prediction in all rows after it."""

    handle: str
    """The quantity, of `effects.law.HANDLES`"""
    place: str
    """MuJoCo's name"""
    motion: RowMotion
    enters: Array
    """Change of the next row's state per unit during a row, of each component, (d, S, T, D)"""
    own: Array
    """And of the prediction in the row itself, (d, S, T, C)"""

    @property
    def channels(self) -> int:
        """How many channels it changes; all, if it changes what goes on."""
        own = (self.own != 0).any(axis=(0, 1, 2))
        return own.size if self.enters.any() else int(own.sum())

    def along(self, direction: Array) -> "LaggedResponse":
        """That of a vector along a direction, (d,), as one component."""
        enters, own = (np.tensordot(direction, each, 1)[None] for each in (self.enters, self.own))
        return replace(self, enters=enters, own=own)

    def products(self, weighed: Array) -> Array:
        """Of what a change in each row does with weights of the prediction, (S, T, C): (d, S, T); runs are
        taken to begin in the same state.
        """
        later = np.einsum("kstd,std->kst", self.enters, self.motion.adjoint(weighed))
        return later + np.einsum("kstc,stc->kst", self.own, weighed)

    def of(self, follows: Array) -> Iterator[Array]:
        """Change of the prediction by changes that follow something, (W, S, T), of one component after the
        other, (W, S, T, C).
        """
        for enters, own in zip(self.enters, self.own, strict=True):
            pushes, shown = (follows[..., None] * np.float32(each) for each in (enters, own))
            yield self.motion.driven(pushes, shown)


Response = PlaceResponse | LaggedResponse
_SENSOR = 3
"""Channels of one sensor at most: those of a marker"""


def in_one_sensor(changed: int, channels: int) -> bool:
    """Whether what changes so many of all channels shows in one sensor alone."""
    return 0 < changed <= min(_SENSOR, channels - 1)


@dataclass(frozen=True)
class MissingTorques:
    """What the joints lacked where they were measured: exact, however far the machine gave way."""

    torque: Array
    """[N m], (S, T, J)"""
    responses: Sequence[PlaceResponse]
    """Torques on the joints by changes at places; changes are (d, S, T, J)"""


class Places:
    """Where reality may differ from a machine's twin, and on what that may depend, in S segments of T
    rows.
    """

    readings: Mapping[tuple[str, str], Array]
    """What laws may follow, (S, T), by the reading and its place"""
    responses: Sequence[Response]
    """Of every quantity at every place"""
    starts: Array | None = None
    """Changes of the prediction by the states in which segments begin, if these are known by noisy readings
    only, (S, k, T, C)
    """
    twin_angles: Mapping[str, Array] = MappingProxyType({})
    """Angles of the twin's joints by name [rad], (S, T); readings have the measured ones. Empty if the twin
    is in the measured pose.
    """
    missing_torques: MissingTorques | None = None
    """What the joints lacked in the measured poses; None of a machine that does not say"""


@dataclass(frozen=True)
class PlacesInRow(Places):
    """What changes at a machine's places show, each in its own row."""

    readings: Mapping[tuple[str, str], Array]
    responses: Sequence[PlaceResponse]
    twin_angles: Mapping[str, Array] = field(default_factory=dict)


def with_more(point: ParameterVector, law: Law, axis: int, more: float) -> ParameterVector:
    """The same twin with more of one component of a constant change, which it may have already."""
    name = f"discovered@{law}"
    values = np.array(point.effects.get(name, np.zeros(len(ranges(Discovered)))))
    values[axis] += more
    return point.having(name, values)


def response_at(places: Places, law: Law) -> Response:
    """What shows of the change that a law makes at its place."""
    at = law.handle, law.place
    return next(each for each in places.responses if (each.handle, each.place) == at)


def by_forces(rotation: Array, middle: Array) -> Iterator[tuple[str, Callable[[Array], Array]]]:
    """What a law may change, and how the changes of anything by it, (d, S, T, C), follow from those by a
    force along the axes of the world, (3, S, T, C): that force itself, one in the body's frame, and a spring.
    `rotation` is the body's, (S, T, 3, 3), `middle` its centre of mass [m], (S, T, 3).
    """
    yield "force", lambda world: world
    yield "force_in_body", lambda world: np.einsum("stxy,xstc->ystc", rotation, world)
    yield (
        SPRING,
        lambda world: np.concatenate([world, -np.einsum("stx,xstc->stc", middle, world)[None]]),
    )
