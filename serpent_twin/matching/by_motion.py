"""Match columns whose names say nothing: by what follows what, by ranges and by simulation."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from serpent_twin.matching import by_name, units
from serpent_twin.matching.by_force import ForceSearch
from serpent_twin.matching.follows import slope
from serpent_twin.matching.robot import SERVO, Actuator
from serpent_twin.matching.trials import Use
from serpent_twin.matching.unmatched import (
    DECISIVE,
    MOST_TRIALS,
    SIMULATED,
    MotionMatches,
    Unmatched,
)

_FOLLOWS = 0.9
"""Correlation from which a column is believed to follow another"""
_ALONE = 0.8
"""Correlation with all other columns below which it follows no other, as a share"""


@dataclass(frozen=True, eq=False)
class MotionSearch:
    """A search for what columns are by what follows what, by ranges and by simulation."""

    of: Unmatched

    def run(self) -> MotionMatches:
        """What motion and simulation say of the pool."""
        found, forces = MotionMatches(), ForceSearch(self.of)
        servos = [a for a in self.of.robot.actuators if a.joint and a.kind == SERVO]
        for each in servos:
            self._one_known(each, found)
        if (
            not self.of.readings
            and not self.of.commands
            and len(servos) < len(self.of.robot.actuators)
        ):
            forces.families(found)
        self._pairs(servos, found)
        forces.forces(found)
        return found

    def _one_known(self, servo: Actuator, found: MotionMatches) -> None:
        """Find the command of a reading, or the reading of a command, that a name told."""
        command, reading = self.of.commands.get(servo.name), self.of.readings.get(servo.joint)
        if bool(command) == bool(reading):
            return
        left = [c for c in self.of.pool if c not in self.of.taken(found)]
        ordered = sorted(
            ((abs(self._how(command or c, reading or c)), c) for c in left), reverse=True
        )
        if not ordered or ordered[0][0] < _FOLLOWS:
            return
        size, column = ordered[0]
        pair = (command or column, reading or column)
        if len(ordered) > 1 and ordered[1][0] > _ALONE * size:
            found.open.append(
                f"{column!r} and {ordered[1][1]!r} both go with {(command or reading)!r}"
            )
        elif self.of.lags.leads(*pair) is not True:
            found.open.append(f"which of {pair[0]!r} and {pair[1]!r} leads")
        elif command:
            found.readings[servo.joint] = column
            found.why[column] = f"follows {command} ({size:.2f}), and no other column does"
        else:
            found.commands[servo.name] = column
            found.why[column] = f"{reading} follows it ({size:.2f}), and no other column"

    def _how(self, command: str, reading: str) -> float:
        return self.of.lags.best(command, reading)[0] if command != reading else 0.0

    def _pairs(self, servos: Sequence[Actuator], found: MotionMatches) -> None:
        """Find commands and readings that go together, and whose they are by ranges and simulation."""
        open_ = [
            a
            for a in servos
            if a.name not in (*self.of.commands, *found.commands)
            and a.joint not in (*self.of.readings, *found.readings)
        ]
        pairs = list(self._mutual(found)) if open_ else []
        if not open_ or not pairs:
            return
        if len(pairs) != len(open_):
            told = ", ".join(f"{r} follows {c}" for c, r in pairs)
            found.open.append(
                f"whose columns these are: {told}, and {len(open_)} actuators have no column"
            )
            return
        if self._by_their_names(open_, pairs, found):
            return
        ranked = self._ranked(open_, pairs, found)
        if not ranked:
            found.open.append("the pairs of command and reading fit no joints by their ranges")
            return
        best, order, share = ranked[0]
        rivals = [o for score, o, _ in ranked[1:] if score < best + DECISIVE]
        for k, (servo, n) in enumerate(zip(open_, order, strict=True)):
            command, reading = pairs[n]
            others = sorted({open_[o.index(n)].joint for o in rivals if o[k] != n})
            if others or (len(open_) > 1 and len(ranked) > 1 and share > SIMULATED):
                told = " or ".join(dict.fromkeys([servo.joint, *others]))
                found.open.append(
                    f"{reading!r} follows {command!r}, but of which joint they are: {told}"
                )
                continue
            found.commands[servo.name], found.readings[servo.joint] = command, reading
            why = "no other joint is left" if len(ranked) < 2 else "other joints leave more"
            if len(open_) > 1 and len(ranked) < 2:
                why = "the ranges of other joints do not fit"
            found.why[reading] = f"follows {command}; {why}"
            found.why[command] = f"{reading} follows it; {why}"

    def _by_their_names(
        self, servos: Sequence[Actuator], pairs: Sequence[tuple[str, str]], found: MotionMatches
    ) -> bool:
        """Whether names tell whose the pairs are, once motion tells which column is a reading."""
        told = by_name.whose(self.of.robot, [self.of.logged.names[reading] for _, reading in pairs])
        if {s.joint for s in servos} != {*told.column}:
            return False
        for servo in servos:
            reading = told.column[servo.joint]
            command = next(c for c, r in pairs if r == reading)
            found.readings[servo.joint], found.commands[servo.name] = reading, command
            found.why[reading] = f"{told.why[servo.joint]}; follows {command}"
            found.why[command] = f"{reading} follows it"
            if servo.joint in told.by_order:
                found.by_order |= {reading, command}
        return True

    def _mutual(self, found: MotionMatches) -> Iterator[tuple[str, str]]:
        """Pairs of columns that go with each other and with no third one, the leading one first."""
        left = [c for c in self.of.pool if c not in self.of.taken(found)]
        size = {
            (a, b): max(abs(self._how(a, b)), abs(self._how(b, a)))
            for a in left
            for b in left
            if a != b
        }
        for a, b in combinations(left, 2):
            third = [size[x, c] for x in (a, b) for c in left if c not in (a, b)]
            if size[a, b] < _FOLLOWS or max(third, default=0.0) > size[a, b] - 0.02:
                continue
            first = self.of.lags.leads(a, b)
            if first is None:
                found.open.append(f"which of {a!r} and {b!r} leads")
                continue
            yield (a, b) if first else (b, a)

    def _ranked(
        self, servos: Sequence[Actuator], pairs: Sequence[tuple[str, str]], found: MotionMatches
    ) -> list[tuple[float, tuple[int, ...], float]]:
        """Orders of pairs over servos by what a simulation leaves, with the worst share of a joint."""
        scores: dict[tuple[int, ...], tuple[float, float]] = {}

        def score(order: tuple[int, ...]) -> float:
            if order not in scores:
                scores[order] = self._scored(servos, [pairs[n] for n in order], found)
            return scores[order][0]

        count = len(servos)
        if count <= 4:
            for order in permutations(range(count)):
                score(order)
        else:
            self._climb(tuple(range(count)), score)
        ranked = [(s, o, share) for o, (s, share) in scores.items() if np.isfinite(s)]
        return sorted(ranked)

    @staticmethod
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
        self, servos: Sequence[Actuator], pairs: Sequence[tuple[str, str]], found: MotionMatches
    ) -> tuple[float, float]:
        """What a simulation leaves if servos have these pairs; infinite if one is beyond a range."""
        readings: dict[str, Use] = self.of.known_readings(found)
        controls: dict[str, Use] = {}
        for servo, (command, reading) in zip(servos, pairs, strict=True):
            use = self.of.reading_of(servo.joint, reading)
            if use is None:
                return np.inf, np.inf
            readings[servo.joint] = use
            gain, _ = slope(
                self.of.logged, command, reading, self.of.lags.best(command, reading)[1]
            )
            hinge = self.of.robot.joint(servo.joint).hinge
            unit = next(
                u for u in ("rad", "deg", "m", "mm") if np.isclose(units.TO_SI[u][0], abs(use[1]))
            )
            told = units.of_servo(self.of.logged, command, unit, gain, hinge, False)
            size = units.TO_SI[told[0] if told else unit][0]
            controls[servo.name] = (command, float(np.sign(gain) or 1) * np.sign(use[1]) * size)
        left = self.of.trials.left(readings, controls)
        return left.score, max(left.share[a.joint] for a in servos)
