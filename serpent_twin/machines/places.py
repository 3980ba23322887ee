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
    """Change of the prediction per unit of each component, (d, S, T, C)"""

    @property
    def channels(self) -> int:
        """How many channels it changes."""
        return int((self.change != 0).any(axis=(0, 1, 2)).sum())

    def along(self, direction: Array) -> "PlaceResponse":
        """Response to a vector along a direction, (d,), as one component."""
        return replace(self, change=np.tensordot(direction, self.change, 1)[None])


@dataclass(frozen=True)
class RowMotion:
    """Row-to-row dynamics linearised about a trajectory, x' = A x and y = C x, of D states in S segments of T
    rows.
    """

    A: Array
    """Changes of the next row's state, (S, T, D, D)"""
    C: Array
    """Changes of the prediction, (S, T, C, D)"""
    adapts: Array | None = None
    """Change of the chosen first state per change of the prediction in the first L rows, (S, D, L, C)"""

    def of_starts(self) -> Array:
        """Changes of the prediction by the state of each segment's first row, (S, D, T, C)."""
        S, T, C, D = self.C.shape
        out, state = np.empty((S, D, T, C)), np.tile(np.eye(D), (S, 1, 1))
        for t in range(T):
            out[:, :, t] = (self.C[:, t] @ state).swapaxes(1, 2)
            state = self.A[:, t] @ state
        return out

    def adjoint(self, weighed: Array) -> tuple[Array, Array]:
        """Derivative of the sum of the prediction times weights, (…, S, T, C), by the state of the row after
        each row, (…, S, T, D); and the weights with what a first state that is chosen by the prediction adds
        to those of the first rows.
        """
        later, first = self._later(weighed)
        if self.adapts is None:
            return later, weighed
        weighed, lead = weighed.copy(), self.adapts.shape[2]
        weighed[..., :lead, :] += np.einsum("sdlc,...sd->...slc", self.adapts, first)
        return self._later(weighed)[0], weighed

    def _later(self, weighed: Array) -> tuple[Array, Array]:
        """Derivatives of the sum of the prediction times weights, (…, S, T, C), by the state of the row after
        each row, (…, S, T, D), where the first state is fixed, and by the first state, (…, S, D).
        """
        T, _, D = self.C.shape[1:]
        out, later = np.zeros((*weighed.shape[:-1], D)), np.zeros((*weighed.shape[:-2], 1, D))
        for t in reversed(range(T)):
            out[..., t, :] = later[..., 0, :]
            later = later @ self.A[:, t] + weighed[..., t, None, :] @ self.C[:, t]
        return out, later[..., 0, :]

    def driven(self, pushes: Array, own: Array) -> Array:
        """Changes of the prediction, (n, S, T, C), by pushes on the state of the row after each row,
        (n, S, T, D), and by what shows in the row itself, (n, S, T, C).
        """
        if self.adapts is None:
            n, S, D = *pushes.shape[:2], pushes.shape[3]
            return self._rows(np.zeros((S, n, D), np.float32), pushes, own)
        lead = self.adapts.shape[2]
        return self._rows(self._begun(pushes[:, :, :lead], own[:, :, :lead]), pushes, own)

    def _begun(self, pushes: Array, own: Array) -> Array:
        """First states, (S, n, D), that follow what is read in the first rows, of pushes, (n, S, L, D), and
        what shows, (n, S, L, C).
        """
        assert self.adapts is not None
        n, S, _, D = pushes.shape
        read = self._rows(np.zeros((S, n, D), np.float32), pushes, own)
        flat = read.swapaxes(0, 1).reshape(S, n, -1)
        begun: Array = flat @ self.adapts.reshape(S, D, -1).swapaxes(1, 2).astype(np.float32)
        return begun

    def gram(self, enters: Array, own: Array, scale: Array) -> Array:
        """Products of what a unit in one row shows with what one in another does, weighed by a scale,
        (S, T, C): (d, d, S, T, T); of units that enter as `LaggedResponse` says.

        By the observability Gramian: what a state shows later, with what others show, is a product of states.
        """
        (S, T, _, D), d = self.C.shape, len(enters)
        shows, weighed = self.C * scale[..., None], own * scale
        out, gramian = np.zeros((d, d, S, T, T)), np.zeros((S, D, D))
        later = np.zeros((S, d, T, D))
        for t in reversed(range(T)):
            e, after, goes_on = enters[:, :, t], slice(t + 1, T), self.A[:, t]
            cross = np.einsum("asi,sbui->absu", e, later[:, :, after])
            out[..., t, after], out[..., after, t] = cross, cross.swapaxes(0, 1)
            by_state = np.einsum("asi,sij->asj", e, gramian)
            out[..., t, t] = np.einsum("asi,bsi->abs", by_state, e)
            out[..., t, t] += np.einsum("asc,bsc->abs", weighed[:, :, t], weighed[:, :, t])
            later[:, :, after] = later[:, :, after] @ goes_on[:, None]
            here = np.einsum("asi,sij->saj", by_state, goes_on)
            later[:, :, t] = here + np.einsum("asc,scj->saj", weighed[:, :, t], shows[:, t])
            gramian = goes_on.swapaxes(1, 2) @ gramian @ goes_on
            gramian += shows[:, t].swapaxes(1, 2) @ shows[:, t]
        if self.adapts is not None:
            begun = np.zeros((S, d, T, D))
            begun[:, :, : self.adapts.shape[2]] = self._begun_by_units(enters, own)
            cross = np.einsum("sati,sbui->abstu", begun, later)
            out += cross + cross.swapaxes(0, 1).swapaxes(3, 4)
            out += np.einsum("sati,sij,sbuj->abstu", begun, gramian, begun, optimize=True)
        return out

    def _begun_by_units(self, enters: Array, own: Array) -> Array:
        """First states by a unit in each of the first rows, (S, d, L, D)."""
        assert self.adapts is not None
        lead, S, d = self.adapts.shape[2], len(self.C), len(enters)
        units = np.eye(lead)[None, :, None, :, None]
        pushes, shown = (units * each[:, None, :, :lead] for each in (enters, own))
        flat = [
            each.reshape(d * lead, *each.shape[2:]).astype(np.float32) for each in (pushes, shown)
        ]
        return self._begun(*flat).reshape(S, d, lead, -1)

    def _rows(self, state: Array, pushes: Array, own: Array) -> Array:
        """Changes of the prediction, (n, S, T, C), by states of the first row, (S, n, D), by pushes on the
        state of the row after each row, (n, S, T, D), and by what shows in the row itself, (n, S, T, C).
        """
        out = np.empty(own.shape, np.float32)
        goes_on, shows = self.A.astype(np.float32), self.C.astype(np.float32)
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
    """Change of the prediction in the row itself per unit of each component, (d, S, T, C)"""

    @property
    def channels(self) -> int:
        """How many channels it changes; all, if it changes what goes on."""
        own = (self.own != 0).any(axis=(0, 1, 2))
        return own.size if self.enters.any() else int(own.sum())

    def along(self, direction: Array) -> "LaggedResponse":
        """Response to a vector along a direction, (d,), as one component."""
        enters, own = (np.tensordot(direction, each, 1)[None] for each in (self.enters, self.own))
        return replace(self, enters=enters, own=own)

    def products(self, weighed: Array) -> Array:
        """Products of what a change in each row shows with weights of the prediction, (…, S, T, C):
        (…, d, S, T).
        """
        return self.by_adjoint(*self.motion.adjoint(weighed))

    def by_adjoint(self, later: Array, weighed: Array) -> Array:
        """Products of what a change in each row shows with weights of the prediction, (…, d, S, T), from what
        `RowMotion.adjoint` makes of the weights, which all places of a motion share.
        """
        by_state = np.einsum("kstd,...std->...kst", self.enters, later)
        return by_state + np.einsum("kstc,...stc->...kst", self.own, weighed)

    def gram(self, scale: Array) -> Array:
        """Products of what a change in one row shows with what one in another does, weighed by a scale,
        (S, T, C): (d, d, S, T, T).
        """
        return self.motion.gram(self.enters, self.own, scale)

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


class Places:
    """Where reality may differ from a machine's twin, and on what that may depend, in S segments of T
    rows.
    """

    readings: Mapping[tuple[str, str], Array]
    """What laws may follow, (S, T), by the reading and its place"""
    responses: Sequence[Response]
    """Responses to a change of every quantity at every place"""
    starts: Array | None = None
    """Changes of the prediction by the states in which segments begin, if these are known by noisy readings
    only, (S, k, T, C)
    """
    twin_angles: Mapping[str, Array] = MappingProxyType({})
    """Angles of the twin's joints by name [rad], (S, T); readings have the measured ones. Empty if the twin
    is in the measured pose.
    """


@dataclass(frozen=True)
class PlacesInRow(Places):
    """What changes at a machine's places show, each in its own row."""

    readings: Mapping[tuple[str, str], Array]
    responses: Sequence[PlaceResponse]
    twin_angles: Mapping[str, Array] = field(default_factory=dict)


def with_more(point: ParameterVector, law: Law, axis: int, more: float) -> ParameterVector:
    """Add to one component of a twin's constant change, which the twin may have already."""
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
