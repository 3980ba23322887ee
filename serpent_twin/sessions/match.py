"""Find a session in a take, and test whether the match is certain."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import IDENTITY, Rigid
from serpent_twin.sessions import agree, labels
from serpent_twin.sessions.align import Clock, refine
from serpent_twin.sessions.film import Film, sampled
from serpent_twin.sessions.search import COVER, findable, peaks, search
from serpent_twin.sessions.suspect_markers import ODD_SCALE

CERTAIN = 0.5  # share of the motion that the prediction must explain
AMBIGUOUS = 1.5  # the second best place leaves at least this many times the best one's square
ROUNDS = 3  # of labels and refinement, each on the other's result


@dataclass(frozen=True, eq=False)
class Match:
    """A session found in a take."""

    clock: Clock
    """The cameras' clock against the log's."""
    rigid: Rigid
    """Cameras to base, fitted on the arm's markers against the prediction."""
    predicted: Array
    """Markers in the base frame that the motors let expect [m], (K, 9, 3)."""
    film: Film
    """Markers 1 … 9 in the cameras' frame, put together from the take's columns."""
    givers: list[dict[int, int]]
    """Number of frames that each of the take's columns gave, for each marker."""
    explained: float
    """Share of the markers' motion that the prediction explains, up to 1."""
    runner_up: float
    """Share of the markers' motion explained at the second best place; a tie would be ambiguous."""


@dataclass(frozen=True, eq=False)
class _Place:
    clock: Clock
    rigid: Rigid
    owner: dict[int, int]
    explained: float


def match(
    time: Array, marker: Array, film: Film, names: Sequence[str], wanted: Sequence[str] = ()
) -> Match:
    """Find a session, of which a twin predicts `marker` (K, 9, 3) at log times (K,), in a film.

    Raises a `SerpentError` if the film does not cover half of it, if no place, or more than one
    place of the film moves as predicted, or if a marker there is not where it should be.
    """
    findable(time, marker, film)
    given = labels.named(names, wanted)
    owner = {column: n for n, column in enumerate(given)} if given else {}
    offset, score = search(time, marker, film)
    places = [
        _place(time, marker, film, Clock(float(offset[i])), owner) for i in peaks(offset, score)
    ]
    if not places:
        raise SerpentError(
            f"the take lasts {len(film.position) / film.rate_hz:.1f} s and holds less than "
            f"{COVER:.0%} of this session of {time[-1] - time[0]:.1f} s. Give the take that was "
            "recorded meanwhile."
        )
    if max(place.explained for place in places) < CERTAIN:
        _refuse_labels(time, marker, film, places, owner, names)
        _refuse_scale_or_mirror(time, marker, film, places, owner)
    best, second = _certain(places)
    clock, rigid, found, givers = best.clock, best.rigid, film, []
    for _ in range(ROUNDS):
        expected = labels.expected_on(clock.log_time(film.time), time, marker, rigid)
        found, givers = labels.track(film, expected, best.owner, bool(given))
        clock, rigid = refine(time, marker, found, clock, rigid)
    expected = labels.expected_on(clock.log_time(film.time), time, marker, rigid)
    agree.refuse_names(film, expected, best.owner if given else {}, names)
    seen = rigid.apply(sampled(found, clock.camera_time(time)))
    explained = _explained(marker, seen)
    return Match(clock, rigid, marker, found, givers, explained, second)


def _refuse_labels(
    time: Array,
    marker: Array,
    film: Film,
    places: list[_Place],
    owner: dict[int, int],
    names: Sequence[str],
) -> None:
    """Raise if one of the places fits once the columns' names are ignored."""
    again = [_place(time, marker, film, place.clock, {}) for place in places] if owner else []
    best = max(again, key=lambda place: place.explained, default=None)
    if best is None or best.explained < CERTAIN:
        return
    wrong = [
        f"{names[column]!r}, given as marker {owner[column] + 1}, looks like marker {n + 1}"
        for column, n in best.owner.items()
        if owner.get(column, n) != n
    ]
    if wrong:
        raise SerpentError(
            f"the take's labels do not fit the motion: {'; '.join(wrong)}. Correct the labels in Motive "
            "and export again, or give the true order with --labels."
        )


def _refuse_scale_or_mirror(
    time: Array, marker: Array, film: Film, places: list[_Place], owner: dict[int, int]
) -> None:
    """Raise if one of the places fits once the film's markers are scaled, or seen in a mirror."""
    shown = film.position[:, np.isfinite(film.position).all(axis=-1).any(axis=0)]
    for mirror in (1, -1):
        scale = _size(np.nanstd(shown, axis=0)) / _size(marker.std(axis=0))
        for _ in range(2):  # by how far the markers move, then by how far they are apart
            seen = replace(film, position=film.position / scale * [1, 1, mirror])
            best = max(
                (_place(time, marker, seen, place.clock, owner) for place in places),
                key=lambda place: place.explained,
            )
            if best.explained == -np.inf:
                break
            there = sampled(film, best.clock.camera_time(time))[:, list(best.owner)]
            wanted = marker[:, list(best.owner.values())]
            scale = _size(there - there.mean(axis=1, keepdims=True))
            scale /= _size(wanted - wanted.mean(axis=1, keepdims=True))
        if best.explained >= CERTAIN:
            raise SerpentError(_scaled_or_turned(scale, mirror, best.explained))


def _scaled_or_turned(scale: float, mirror: int, explained: float) -> str:
    odd = abs(scale - 1) > ODD_SCALE
    what = [f"{scale:.4g} times as far apart as the arm's"] * odd + ["mirrored"] * (mirror < 0)
    return (
        f"the take's markers are {' and '.join(what)}; with that undone, the motors explain "
        f"{explained:.0%} of their motion. Calibrate the cameras with their wand's true length, or export "
        "the take again in the unit and the axes that it names."
    )


def _size(vectors: Array) -> float:
    """Median length of vectors (..., 3) [m] that are known."""
    return float(np.nanmedian(np.linalg.norm(vectors, axis=-1)))


def _place(time: Array, marker: Array, film: Film, clock: Clock, owner: dict[int, int]) -> _Place:
    """A candidate: its labels if not given, a first rigid fit, and what that explains."""
    seen = sampled(film, clock.camera_time(time))
    stride = max(1, round(0.25 / float(np.median(np.diff(time)))))
    owner = owner or labels.assigned(marker, seen, stride)
    owner = {c: m for c, m in owner.items() if np.isfinite(seen[:, c]).any()}
    columns, markers = list(owner), list(owner.values())
    source, target = seen[:, columns], marker[:, markers]
    shown = np.isfinite(source).all(axis=-1).mean(axis=0) > labels.SHOWN
    hopeless = _Place(clock, IDENTITY, owner, -np.inf)
    if shown.sum() < 3:
        return hopeless
    try:
        rigid = labels.trimmed_fit(source, target)
    except SerpentError:
        return hopeless
    return _Place(clock, rigid, owner, _explained(target, rigid.apply(source)))


def _explained(marker: Array, seen: Array) -> float:
    """Share of the motion of `seen` markers (K, m, 3) that the prediction `marker` accounts for.

    Squares are compared by their medians, which a label that swaps half-way does not move.
    """
    known = np.isfinite(seen).any(axis=(0, 2))
    marker, seen = marker[:, known], seen[:, known]
    motion = seen - np.nanmean(seen, axis=0)
    left, whole = (np.nanmedian((x**2).sum(axis=-1)) for x in (seen - marker, motion))
    return 1.0 - float(left / max(whole, 1e-12))


def _certain(places: list[_Place]) -> tuple[_Place, float]:
    """The one place that fits, and what the second best explains; raises if there is none or two."""
    order = sorted(places, key=lambda place: -place.explained)
    best, second = order[0], order[1].explained if len(order) > 1 else -np.inf
    if best.explained == -np.inf:
        raise SerpentError(
            "no place of the take shows three markers for long enough to compare them with the "
            "motors; three are needed. Record a take in which more of them are visible."
        )
    if best.explained < CERTAIN:
        raise SerpentError(
            "no place of the take moves as this session's motors did: at the best one, the motors "
            f"explain {max(best.explained, 0.0):.0%} of the markers' motion, {CERTAIN:.0%} are needed. "
            "It is another recording's take, or its markers are others (see --labels)."
        )
    if 1 - second < AMBIGUOUS * (1 - best.explained):
        raise SerpentError(
            "two places of the take fit this session almost equally well, at "
            f"{order[0].clock.offset:.2f} s and {order[1].clock.offset:.2f} s of the cameras' clock: "
            f"the motors explain {best.explained:.1%} and {second:.1%} of the motion. Record a longer "
            "session, or export only its part of the take."
        )
    return best, max(second, 0.0)
