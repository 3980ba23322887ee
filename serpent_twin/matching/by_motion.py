"""Match columns whose names say nothing: by what follows what, by ranges and by simulation."""

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, permutations

import numpy as np

from serpent_twin.matching import by_name
from serpent_twin.matching.by_force import MOST_TRIALS, find_forces
from serpent_twin.matching.follows import slope
from serpent_twin.matching.matches import BELIEVED, DECISIVE, Matches
from serpent_twin.matching.robot import SERVO, Actuator
from serpent_twin.matching.trials import Use
from serpent_twin.units import TO_SI

_FOLLOWS = 0.9
"""Correlation from which a column is believed to follow another"""
_ALONE = 0.8
"""Correlation with all other columns below which it follows no other, as a share"""
Pair = tuple[str, str]
"""Columns of a command and of the reading that follows it"""


def match(found: Matches, pool: Sequence[str]) -> None:
    """Match columns of a pool, of which names do not tell what they are."""
    servos = [a for a in found.robot.actuators if a.joint and a.kind == SERVO]
    for each in servos:
        _match_known(each, found, pool)
    _match_pairs(servos, found, pool)
    find_forces(found, pool)


def _match_known(servo: Actuator, found: Matches, pool: Sequence[str]) -> None:
    """Find the command of a reading, or the reading of a command, that a name told."""
    command, reading = found.commands.get(servo.name), found.readings.get(servo.joint)
    if bool(command) == bool(reading):
        return
    left = [c for c in pool if c not in found.taken]
    ordered = sorted(
        ((abs(_correlation(command or c, reading or c, found)), c) for c in left), reverse=True
    )
    if not ordered or ordered[0][0] < _FOLLOWS:
        return
    size, column = ordered[0]
    pair = (command or column, reading or column)
    if len(ordered) > 1 and ordered[1][0] > _ALONE * size:
        several = f"{column!r} and {ordered[1][1]!r}"
        found.open.append(f"{several} both go with {(command or reading)!r}")
    elif found.lags.leads(*pair) is not True:
        found.open.append(f"which of {pair[0]!r} and {pair[1]!r} leads")
    elif command:
        found.readings[servo.joint] = column
        found.say(column, f"follows {command} ({size:.2f}), and no other column does")
    else:
        found.commands[servo.name] = column
        found.say(column, f"{reading} follows it ({size:.2f}), and no other column")


def _correlation(command: str, reading: str, found: Matches) -> float:
    return found.lags.best(command, reading)[0] if command != reading else 0.0


def _match_pairs(servos: Sequence[Actuator], found: Matches, pool: Sequence[str]) -> None:
    """Find commands and readings that go together, and whose they are by ranges and simulation."""
    open_ = [a for a in servos if a.name not in found.commands and a.joint not in found.readings]
    pairs = list(_mutual(found, pool)) if open_ else []
    if not pairs:
        return
    if len(pairs) != len(open_):
        told = ", ".join(f"{r} follows {c}" for c, r in pairs)
        found.open.append(
            f"whose columns these are: {told}, and {len(open_)} actuators have no column"
        )
        return
    if _match_names(open_, pairs, found):
        return
    ranked = _ranked(open_, pairs, found)
    if not ranked:
        found.open.append("the pairs of command and reading fit no joints by their ranges")
        return
    best, order, share = ranked[0]
    rivals = [o for score, o, _ in ranked[1:] if score < best + DECISIVE]
    why = "no other joint is left" if len(ranked) < 2 else "other joints leave more"
    if len(open_) > 1 and len(ranked) < 2:
        why = "the ranges of other joints do not fit"
    for k, (servo, n) in enumerate(zip(open_, order, strict=True)):
        command, reading = pairs[n]
        others = sorted({open_[o.index(n)].joint for o in rivals if o[k] != n})
        if others or (len(open_) > 1 and len(ranked) > 1 and share > BELIEVED):
            told = " or ".join(dict.fromkeys([servo.joint, *others]))
            found.open.append(
                f"{reading!r} follows {command!r}, but of which joint they are: {told}"
            )
            continue
        found.commands[servo.name], found.readings[servo.joint] = command, reading
        found.say(reading, f"follows {command}; {why}")
        found.say(command, f"{reading} follows it; {why}")


def _match_names(servos: Sequence[Actuator], pairs: Sequence[Pair], found: Matches) -> bool:
    """Whether names tell whose the pairs are, once motion tells which column is a reading."""
    told = by_name.whose(found.robot, [found.logged.names[reading] for _, reading in pairs])
    if {s.joint for s in servos} != {*told.column}:
        return False
    for servo in servos:
        reading = told.column[servo.joint]
        command = next(c for c, r in pairs if r == reading)
        found.readings[servo.joint], found.commands[servo.name] = reading, command
        found.say(reading, f"{told.why[servo.joint]}; follows {command}")
        found.say(command, f"{reading} follows it")
        if servo.joint in told.by_order:
            found.by_order |= {reading, command}
    return True


def _mutual(found: Matches, pool: Sequence[str]) -> Iterator[Pair]:
    """Pairs of columns that go with each other and with no third one, the leading one first."""
    left = [c for c in pool if c not in found.taken]
    size = {
        (a, b): max(abs(_correlation(a, b, found)), abs(_correlation(b, a, found)))
        for a, b in permutations(left, 2)
    }
    for a, b in combinations(left, 2):
        third = [size[x, c] for x in (a, b) for c in left if c not in (a, b)]
        if size[a, b] < _FOLLOWS or max(third, default=0.0) > size[a, b] - 0.02:
            continue
        first = found.lags.leads(a, b)
        if first is None:
            found.open.append(f"which of {a!r} and {b!r} leads")
        else:
            yield (a, b) if first else (b, a)


def _ranked(
    servos: Sequence[Actuator], pairs: Sequence[Pair], found: Matches
) -> list[tuple[float, tuple[int, ...], float]]:
    """Orders of pairs over servos by what a simulation leaves, with the worst share of a joint."""
    scores: dict[tuple[int, ...], tuple[float, float]] = {}

    def score(order: tuple[int, ...]) -> float:
        if order not in scores:
            scores[order] = _scored(servos, [pairs[n] for n in order], found)
        return scores[order][0]

    count = len(servos)
    if count <= 4:
        for order in permutations(range(count)):
            score(order)
    else:
        _climb(tuple(range(count)), score)
    return sorted((s, o, share) for o, (s, share) in scores.items() if np.isfinite(s))


def _climb(order: tuple[int, ...], score: Callable[[tuple[int, ...]], float]) -> None:
    """Exchange two at a time while that leaves less; the last round has tried all exchanges."""
    for _ in range(MOST_TRIALS // len(order)):
        several = []
        for a, b in combinations(range(len(order)), 2):
            other = list(order)
            other[a], other[b] = order[b], order[a]
            several.append(tuple(other))
        best = min(several, key=score)
        if score(best) >= score(order):
            return
        order = best


def _scored(
    servos: Sequence[Actuator], pairs: Sequence[Pair], found: Matches
) -> tuple[float, float]:
    """What a simulation leaves if servos have these pairs; infinite if one is beyond a range."""
    readings = found.known_readings()
    controls: dict[str, Use] = {}
    for servo, (command, reading) in zip(servos, pairs, strict=True):
        use = found.reading_of(servo.joint, reading)
        if use is None:
            return np.inf, np.inf
        readings[servo.joint] = use
        gain = slope(found.logged, command, reading, found.lags.best(command, reading)[1])
        unit = next(u for u in ("rad", "deg", "m", "mm") if np.isclose(TO_SI[u][0], abs(use[1])))
        size = TO_SI[found.units.of_servo(servo, command, unit, gain)[0]][0]
        controls[servo.name] = (command, float(np.sign(gain) or 1) * np.sign(use[1]) * size)
    left = found.trials.left(readings, controls)
    return left.score, max(left.share[a.joint] for a in servos)
