"""Find where and how the twin lacks something, to first order and without simulation.

A law changes the prediction in each row by f(reading) times what its place shows there. What it would remove
of the residual's squares follows, beyond what the free parameters take up, from sums over rows alone:
with F the ways in which a change may follow readings, h the residual's product with the place's response, and
D that of the Jacobian, the pull is F h and the Gram matrix F² |R|² − w (F D) M⁻¹ (F D)ᵀ. The Jacobian is by
combinations of the parameters for which M is the unit matrix.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects.law import HANDLES, Law
from serpent_twin.identification.discovery.composed import (
    PER_PARAMETER,
    Composed,
    from_then_on,
)
from serpent_twin.identification.discovery.followed import (
    Way,
    around,
    rows_of,
    swinging,
    swings,
    ways,
)
from serpent_twin.identification.discovery.rows_in_time import RowsInTime
from serpent_twin.identification.discovery.sizes import FLAT, of_one_phase, shows_flat, solved
from serpent_twin.identification.discovery.sums import (
    Changes,
    ResidualRows,
    ShownChanges,
    Sums,
    beyond,
    by_row,
    columns,
    shown,
)
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.information import Information
from serpent_twin.machines.case import Case
from serpent_twin.machines.places import Places, Response, in_one_sensor

_EACH, _REFINED = 4, 12
"""Laws that are kept at each place, and those whose thresholds are sought more finely before: readings that
move alike differ by less than the steps between the first thresholds
"""
_TIMES = (("time", "session"), ("runtime", "machine"))
_MOST = 0.99
"""Share of the residual's squares that a law is taken to remove at most"""
_SAME = 1e-3
"""Below this share of its squares beyond the declared parameters, a change counts as theirs"""
_ROUNDING = 1e-14
"""Eigenvalues of an information matrix below this fraction of the greatest may be rounding"""


def screened(case: Case[Any], pieces: Any, fit: Fit, places: Places) -> list[Composed]:
    """The best laws at each place, the best first, by the segments that a fit used."""
    return Search.of(case, pieces, fit, places).best(places.responses)


class Search:
    """What all places share: a residual (S, T, C), weighed by a scale (S, T, C), the information that it
    holds on the free parameters, and what laws may follow.
    """

    def __init__(
        self,
        residual: Array,
        scale: Array,
        known: Information,
        readings: Mapping[tuple[str, str], Array],
        starts: Array | None = None,
    ) -> None:
        free = columns(starts, scale)
        slopes = beyond(free, known.slopes.astype(float).reshape(-1, *scale.shape))
        known = replace(known, slopes=slopes.reshape(len(slopes), scale.size))
        self.readings = readings
        self.in_time = RowsInTime.among(readings)
        self.ways, rows = ways(readings, self.in_time)
        self.usual = Changes(rows)
        kinds = list(map(_kind, self.ways))
        self._kinds = {kind: n for n, kind in enumerate(dict.fromkeys(kinds))}
        self._kind = np.array([self._kinds[kind] for kind in kinds])
        self.weight, self.channels = known.weight, scale.shape[-1]
        residual = beyond(free, residual.astype(float)).ravel()
        pull = known.weight * (known.slopes @ residual) + known.prior * known.lean
        self.total = float(residual @ residual)
        value, axes = np.linalg.eigh(known.matrix)
        spread = np.sqrt(np.maximum(value, _ROUNDING * value.max(initial=0.0)))
        to_unit, from_unit = (axes / spread).T, axes * spread
        without = np.linalg.pinv(known.slopes @ known.slopes.T, rcond=FLAT**2, hermitian=True)
        self.without_priors = from_unit.T @ without @ from_unit
        slopes = to_unit @ known.slopes
        left = residual - slopes.T @ (to_unit @ pull)
        shape = (scale.size // self.channels, self.channels)
        self.rows = ResidualRows(
            left.reshape(shape), slopes.reshape(len(slopes), *shape), scale, free
        )

    @classmethod
    def of(cls, case: Case[Any], pieces: Any, fit: Fit, places: Places) -> Self:
        """The search beside a fit, on the segments that the fit used."""
        scale = np.where(np.isfinite(pieces.measured), 1 / case.noise, 0.0)
        residual = fit.residual.reshape(scale.shape)
        return cls(residual, scale, Information.of(case, fit), places.readings, places.starts)

    def best(self, responses: Sequence[Response]) -> list[Composed]:
        """The best laws at each place, the best first."""
        swings = self.swings(responses)
        found = [each for n, one in enumerate(responses) for each in self.at(one, swings[n])]
        return sorted(found, key=lambda each: -each.worth)

    def swings(self, responses: Sequence[Response]) -> list[list[Way]]:
        """The swings by each time that are tried at each place."""
        out: list[list[Way]] = [[] for _ in responses]
        found = [by_row(self.rows, response) for response in responses]
        widest = max(len(each) for each, _ in found)
        products, squares = np.zeros((2, len(responses), widest, len(self.rows.left)))
        for n, (product, square) in enumerate(found):
            products[n, : len(product)], squares[n, : len(square)] = product, square
        for name in (each for each in _TIMES if each in self.readings):
            peaks = swings(self.readings[name], products, squares)
            for several, rates in zip(out, peaks, strict=True):
                several += [each for rate in rates for each in swinging(name, rate)]
        return out

    def at(self, response: Response, besides: Sequence[Way] = ()) -> list[Composed]:
        """The best laws at a place, some ways beside the usual ones included."""
        here = shown(self.rows, response)
        which = np.flatnonzero(self._possible(response)[self._kind])
        several = [self.ways[n] for n in which]
        found = here.sums(self.usual, which if len(which) < len(self.ways) else None)
        if more := [way for way in besides if _law(response, way).possible]:
            several, found = [*several, *more], found.then(here.sums(self.changes(more)))
        kept = self._best(response, several, found, _REFINED)
        finer = [
            way for each in kept for way in around(each.law, each.first, each.second, self.readings)
        ]
        if finer:
            kept = _best_of([*kept, *self._among(here, response, finer, _REFINED)])
        kept = _first_few(kept)
        declared = self._declared(here)
        kept = [each if each.law.reading else replace(each, declared=declared) for each in kept]
        return [from_then_on(each) for each in kept]

    def _possible(self, response: Response) -> NDArray[np.bool_]:
        """Whether a place may change in each of the usual ways."""
        laws = (Law(response.handle, response.place, *kind) for kind in self._kinds)
        return np.array([law.possible for law in laws])

    def _declared(self, here: ShownChanges) -> bool:
        """Whether declared parameters could do what a constant change does, were it not for their priors."""
        found = here.sums(Changes(np.ones((1, self.usual.rows.shape[1]), np.float32)))
        taken = found.taken[:, 0]
        left = found.raw[0] - taken @ self.without_priors @ taken.T
        return bool(np.trace(left) < _SAME * np.trace(found.raw[0]))

    def among(
        self, response: Response, several: Sequence[Way], most: int = _EACH
    ) -> list[Composed]:
        """The best of some laws at a place, one for each reading."""
        return self._among(shown(self.rows, response), response, several, most)

    def changes(self, several: Sequence[Way]) -> Changes:
        """The changes of some ways in all rows."""
        return Changes(rows_of(several, self.readings, self.in_time))

    def together(self, response: Response, F: Array) -> tuple[Array, Array, float]:
        """Sizes of several changes at once, (W,), of a place with one component, their standard errors, and
        the squared standard errors that they remove together.
        """
        raw, pull, taken = shown(self.rows, response).between(Changes(F))
        gram = raw - self.weight * taken @ taken.T
        inverse = np.linalg.pinv(gram, rcond=FLAT, hermitian=True)
        size = -inverse @ pull
        error = np.sqrt(np.maximum(np.diag(inverse), 0.0) / self.weight)
        return size, error, self.weight * float(-size @ pull)

    def gain(self, share: Array) -> Array:
        """Twice the logarithm of the likelihood ratio of what removes a share of the residual's squares."""
        return -self.weight * self.total * np.log1p(-np.minimum(share, _MOST))

    def _among(
        self, here: ShownChanges, response: Response, several: Sequence[Way], most: int
    ) -> list[Composed]:
        return self._best(response, several, here.sums(self.changes(several)), most)

    def _beyond_free(self, found: Sums) -> tuple[Sums, Array]:
        """Sums of a place, and their Gram matrices, (W, d, d), beyond what the free parameters take up."""
        taken, now, next_ = found.taken, found.taken[:, :-1], found.taken[:, 1:]
        gram = found.raw - self.weight * np.einsum("awm,bwm->wab", taken, taken)
        beside = found.beside - self.weight * np.einsum("awm,bwm->wab", now, next_)
        return replace(found, beside=beside), gram

    def _best(
        self, response: Response, tried: Sequence[Way], raw: Sums, most: int
    ) -> list[Composed]:
        """The best laws at a place, among some ways with their sums."""
        found, grams = self._beyond_free(raw)
        size, gain = solved(found.pulls, grams, found.raw)
        handle = HANDLES[response.handle]
        if handle.only_more:
            gain = np.where(size[:, -1] > 0, gain, 0.0)
        phased, sizes, gains = of_one_phase(tried, found, grams)
        several = [*tried, *phased]
        size, gain = np.concatenate([size, sizes]), np.concatenate([gain, gains])
        periodic = np.array([each.shape == "periodic" for each in several])
        share = np.where(periodic & (np.arange(len(several)) < len(tried)), 0.0, gain) / self.total
        gain = self.gain(share)
        if handle.only_more:  # friction that follows a swing would be negative at times
            gain = np.where(periodic, 0.0, gain)
        cost = np.array([PER_PARAMETER * each.parameters for each in several])
        kept: list[Composed] = []
        alone = in_one_sensor(response.channels, self.channels)
        shapes_of = _best_shapes(several, gain)
        for n in np.argsort(cost - gain):
            way = several[n]
            if gain[n] <= cost[n]:
                break
            if len(kept) >= most and way.reading:  # a constant is kept beside them
                continue
            if any((way.reading, way.where) == (k.law.reading, k.law.where) for k in kept):
                continue
            best = {
                shape: _composed(response, several[k], size[k], float(gain[k]), float(share[k]))
                for shape, k in shapes_of[way.reading, way.where].items()
                if shape != way.shape
            }
            one = _composed(response, way, size[n], float(gain[n]), float(share[n]))
            flat = n < len(tried) and shows_flat(found.raw[n])
            kept.append(replace(one, alone=alone, flat=flat, shapes=best))
        return kept


def _first_few(found: Sequence[Composed]) -> list[Composed]:
    """The first laws at a place, and a constant besides."""
    return [each for n, each in enumerate(found) if n < _EACH or not each.law.reading]


def _best_shapes(several: Sequence[Way], gain: Array) -> dict[tuple[str, str], dict[str, int]]:
    """Index of the way that gains most in each shape, for each reading."""
    out: dict[tuple[str, str], dict[str, int]] = {}
    for n in np.argsort(gain, kind="stable"):
        out.setdefault((several[n].reading, several[n].where), {})[several[n].shape] = int(n)
    return out


def _composed(response: Response, way: Way, size: Array, gain: float, share: float) -> Composed:
    return Composed(_law(response, way), size, way.first, way.second, gain, share)


def _kind(way: Way) -> tuple[str, str, str]:
    return way.shape, way.reading, way.where


def _law(response: Response, way: Way) -> Law:
    return Law(response.handle, response.place, *_kind(way))


def _best_of(found: Sequence[Composed]) -> list[Composed]:
    """The best of those that follow the same reading."""
    best: dict[tuple[str, str], Composed] = {}
    for each in sorted(found, key=lambda each: -each.worth):
        one = best.setdefault((each.law.reading, each.law.where), each)
        if one is not each:
            both = sorted((*one.shapes.values(), *each.shapes.values(), each), key=lambda x: x.gain)
            shapes = {x.law.shape: x for x in both if x.law.shape != one.law.shape}
            best[each.law.reading, each.law.where] = replace(one, shapes=shapes)
    return list(best.values())
