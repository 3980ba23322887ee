"""Differentiate what is measured of a motion by the numbers of its model, if a simulation agrees."""

from collections.abc import Callable, Sequence

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.machine import Declared, ParameterVector
from serpent_twin.machines.model.in_motion import MovingTwin, TwinsInMotion
from serpent_twin.machines.model.known_motion import KnownMotion
from serpent_twin.machines.model.number_changes import by_numbers
from serpent_twin.machines.model.row_motion import adapted, free_of
from serpent_twin.machines.model.seen import Seen
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.tables.segments import Segments

_SEED = 0
"""Seed of the signs of the step that is simulated to check derivatives"""
_PROBED = 0.1
"""Largest size of the step that is simulated to check derivatives, in steps of the numbers"""
_MIN_STEPS = 100
"""Time steps of a row, of all simulations that are saved, from which derivatives along one motion are
quicker: with 10 numbers in 8 steps they take 1.0 … 1.2 times as long
"""
_MAX_ERROR = 0.3
"""Most that a simulated step may differ from what derivatives predict, of what the numbers change one by one
(root of the sum of squares: together they may cancel), for these to be used
"""
_CHECKED = 4
"""Segments of a motion that are simulated to check derivatives"""
MANY = 100
"""Numbers for which differences, a simulation each, take so long that derivatives along one motion are used
however right they are: where a motion is chaotic neither says much, and a fit takes only steps that help
"""
Stepped = Callable[[Sequence[Declared]], MovingTwin]
"""A twin that is a step of some numbers further"""


def worthwhile(
    twin: TwinsInMotion,
    stepped: Stepped,
    respond: Callable[[Sequence[ParameterVector], Segments], Array],
    point: ParameterVector,
    declared: Sequence[Declared],
    pieces: Segments,
    noise: Array,
) -> dict[str, Array]:
    """Derivatives of a twin's channels at a point, (S, T, C) each, that one motion tells; none where
    simulations are quicker, or disagree with them by the noise of each channel, (C,).
    """
    if len(declared) * twin.steps < _MIN_STEPS:
        return {}
    found = derivatives(twin, stepped, declared, pieces)
    if len(declared) > MANY:
        return found
    some = range(0, len(pieces), -(-len(pieces) // _CHECKED))
    probed = {name: change[some] for name, change in found.items()}

    def shown(points: Sequence[ParameterVector]) -> Array:
        return respond(points, pieces.take(some))

    return found if agree(probed, declared, point, shown, noise) else {}


def derivatives(
    twin: TwinsInMotion, stepped: Stepped, declared: Sequence[Declared], pieces: Segments
) -> dict[str, Array]:
    """Derivatives of what is measured of a twin by the numbers that are fitted, (S, T, C) each, where they
    follow from one simulated motion. Lacking are those of prescribed motion, and all where a state holds more
    than what is measured.
    """
    model = twin.twins[0].driven(pieces).models[0]
    if twin.replays(model, pieces) or not model.njnt == model.nq == model.nv:
        return {}
    motion = twin.motion(pieces)
    singles = {each.name: stepped([each]) for each in declared}
    runs = {name: other.driven(pieces) for name, other in singles.items()}
    along = [
        each for each in declared if _follows_alike(motion.driven.known, runs[each.name].known)
    ]

    def changed(groups: Sequence[Sequence[int]]) -> tuple[list[DrivenRuns], Seen]:
        found, xs = [], [twin.twins[0].x]
        for which in groups:
            several = [along[p] for p in which]
            name = several[0].name
            other = stepped(several) if several[1:] else singles[name]
            found.append(other.driven(pieces) if several[1:] else runs[name])
            xs.append(other.x)
        return found, Seen(twin.machine, twin.frame, xs)

    kinds = [each.name.split(" of ")[0] for each in along]
    rows, pushes, own = by_numbers(motion, kinds, changed)
    rows = adapted(rows, twin.measured, motion, free_of(motion.driven))
    found = rows.driven(pushes, own)
    if len(declared) > MANY:
        found = own + _cut(found - own, along, pieces.measured)
    return {each.name: of / each.step for each, of in zip(along, found, strict=True)}


def _cut(changes: Array, declared: Sequence[Declared], measured: Array) -> Array:
    """Changes by a step of each number that come from the rows before, (P, S, T, C), cut to what a width of
    its prior can do: where a motion is chaotic, what is infinitesimal grows without end, but nothing that is
    measured, (S, T, C), changes by more than its span.
    """
    known = measured.reshape(-1, measured.shape[-1])
    most, least = np.fmax.reduce(known), np.fmin.reduce(known)
    share = np.array([each.step / each.prior for each in declared])
    span = np.nan_to_num(most - least) * share[:, None, None, None]
    return np.clip(np.nan_to_num(changes), -span, span)


def agree(
    found: dict[str, Array],
    declared: Sequence[Declared],
    point: ParameterVector,
    shown: Callable[[Sequence[ParameterVector]], Array],
    noise: Array,
) -> bool:
    """Whether a step of all numbers at once changes what twins show, (D, S, T, C), as derivatives predict,
    each channel by its noise, (C,).
    """
    each = [found[of.name] * of.step / noise if of.name in found else None for of in declared]
    size = np.array([0.0 if of is None else np.linalg.norm(of) for of in each])
    if not size.any():
        return True
    alike = np.minimum(1.0, np.median(size[size > 0]) / np.where(size > 0, size, np.inf))
    share = _PROBED * alike * np.random.default_rng(_SEED).choice([-1.0, 1.0], len(size))
    there, here = shown([point.after(share * [of.step for of in declared]), point])
    change = np.nan_to_num((there - here) / noise)
    predicted = sum(k * of for k, of in zip(share, each, strict=True) if of is not None)
    return bool(np.linalg.norm(change - predicted) < _MAX_ERROR * np.linalg.norm(share * size))


def _follows_alike(one: KnownMotion | None, other: KnownMotion | None) -> bool:
    """Whether two twins' prescribed motions are the same."""
    return one is other or bool(one and other and np.array_equal(one.at, other.at))
