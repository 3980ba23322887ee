"""Match columns whose names say nothing: by what follows what, by ranges and by simulation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations

import numpy as np

from serpent_twin.matching import by_name, units
from serpent_twin.matching.follows import Lagged, slope
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import SERVO, SPEED, Actuator, Robot
from serpent_twin.matching.trials import Trials, Use

_FOLLOWS = 0.9
"""Correlation from which a column is believed to follow another"""
_ALONE = 0.8
"""Correlation with all other columns below which it follows no other, as a share"""
_RATE = 0.97
"""Correlation of a column with the rate of another from which it is its velocity"""
_DECISIVE = float(np.log(1.5))
"""By how much (of a logarithm) an assignment must leave less than all others"""
_SIMULATED = 0.75
"""Share of the motion that the right assignment leaves at most"""
_MOST_TRIALS = 130
"""Assignments that are simulated at most"""
Assignment = dict[str, str]


@dataclass
class MotionMatches:
    """Columns by joint and by actuator, with reasons, and what motion leaves open."""

    readings: Assignment = field(default_factory=dict)
    commands: Assignment = field(default_factory=dict)
    why: dict[str, str] = field(default_factory=dict)
    """By column"""
    by_order: set[str] = field(default_factory=set)
    """Columns whose number alone tells whose they are"""
    open: list[str] = field(default_factory=list)
    """Sentences on what was not decided"""


def velocities(logged: Logged, columns: Sequence[str]) -> dict[str, str]:
    """Columns that are the rate of another one, by their own name."""
    if len(columns) < 2:
        return {}
    from serpent_twin.matching.follows import lagged

    found: dict[str, str] = {}
    table = lagged(logged, columns, rates=True)
    for of in columns:
        for own in columns:
            if of != own and table.best(of, own)[0] > _RATE and own not in found:
                found[own] = of
    return found


@dataclass(frozen=True, eq=False)
class Search:
    """Columns without names of use, and joints and actuators without columns."""

    robot: Robot
    logged: Logged
    trials: Trials
    lags: Lagged
    readings: Mapping[str, str]
    """By joint, by names"""
    commands: Mapping[str, str]
    """By actuator, by names"""
    pool: Sequence[str]
    """Columns of which names do not tell what they are"""

    def run(self) -> MotionMatches:
        """What motion and simulation say of the pool."""
        found = MotionMatches()
        servos = [a for a in self.robot.actuators if a.joint and a.kind == SERVO]
        for each in servos:
            self._one_known(each, found)
        self._pairs(servos, found)
        self._forces(found)
        return found

    def _taken(self, found: MotionMatches) -> set[str]:
        known = (self.readings, self.commands, found.readings, found.commands)
        return {column for each in known for column in each.values()}

    def _one_known(self, servo: Actuator, found: MotionMatches) -> None:
        """Find the command of a reading, or the reading of a command, that a name told."""
        command, reading = self.commands.get(servo.name), self.readings.get(servo.joint)
        if bool(command) == bool(reading):
            return
        left = [c for c in self.pool if c not in self._taken(found)]
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
        elif self.lags.leads(*pair) is not True:
            found.open.append(f"which of {pair[0]!r} and {pair[1]!r} leads")
        elif command:
            found.readings[servo.joint] = column
            found.why[column] = f"follows {command} ({size:.2f}), and no other column does"
        else:
            found.commands[servo.name] = column
            found.why[column] = f"{reading} follows it ({size:.2f}), and no other column"

    def _how(self, command: str, reading: str) -> float:
        return self.lags.best(command, reading)[0] if command != reading else 0.0

    def _pairs(self, servos: Sequence[Actuator], found: MotionMatches) -> None:
        """Find commands and readings that go together, and whose they are by ranges and simulation."""
        open_ = [
            a
            for a in servos
            if a.name not in (*self.commands, *found.commands)
            and a.joint not in (*self.readings, *found.readings)
        ]
        pairs = list(self._mutual(found)) if open_ else []
        if not open_ or not pairs:
            return
        if len(pairs) != len(open_):
            told = ", ".join(f"{r} follows {c}" for c, r in pairs)
            found.open.append(f"whose columns these are: {told}, and {len(open_)} actuators have no column")
            return
        if self._by_their_names(open_, pairs, found):
            return
        ranked = self._ranked(open_, pairs, found)
        if not ranked:
            found.open.append("the pairs of command and reading fit no joints by their ranges")
            return
        best, order, share = ranked[0]
        rivals = [o for score, o, _ in ranked[1:] if score < best + _DECISIVE]
        for k, (servo, n) in enumerate(zip(open_, order, strict=True)):
            command, reading = pairs[n]
            others = sorted({open_[o.index(n)].joint for o in rivals if o[k] != n})
            if others or (len(open_) > 1 and len(ranked) > 1 and share > _SIMULATED):
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
        told = by_name.whose(self.robot, [self.logged.names[reading] for _, reading in pairs])
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
        left = [c for c in self.pool if c not in self._taken(found)]
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
            first = self.lags.leads(a, b)
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
    def _climb(order: tuple[int, ...], score: object) -> None:
        """Exchange two at a time while that leaves less; the last round has tried all exchanges."""
        assert callable(score)
        for _ in range(_MOST_TRIALS // len(order)):
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
        readings: dict[str, Use] = self._known_readings(found)
        controls: dict[str, Use] = {}
        for servo, (command, reading) in zip(servos, pairs, strict=True):
            use = self._reading(servo.joint, reading)
            if use is None:
                return np.inf, np.inf
            readings[servo.joint] = use
            gain, _ = slope(self.logged, command, reading, self.lags.best(command, reading)[1])
            hinge = self.robot.joint(servo.joint).hinge
            unit = next(
                u for u in ("rad", "deg", "m", "mm") if np.isclose(units.TO_SI[u][0], abs(use[1]))
            )
            told = units.of_servo(self.logged, command, unit, gain, hinge, False)
            size = units.TO_SI[told[0] if told else unit][0]
            controls[servo.name] = (command, float(np.sign(gain) or 1) * np.sign(use[1]) * size)
        left = self.trials.left(readings, controls)
        return left.score, max(left.share[a.joint] for a in servos)

    def _known_readings(self, found: MotionMatches) -> dict[str, Use]:
        known = {**self.readings, **found.readings}
        several = {joint: self._reading(joint, column) for joint, column in known.items()}
        return {joint: use for joint, use in several.items() if use}

    def _reading(self, joint: str, column: str) -> Use | None:
        """A column as a joint's reading in its likeliest unit; None if it is beyond the range in all."""
        one = self.robot.joint(joint)
        judged = units.of_reading(self.robot, self.logged, one, column)
        if not judged.believed:
            return None
        unit = judged.believed[0]
        if unit not in ("rad", "deg", "m", "mm"):
            return None
        sign = units.signs_of_reading(self.robot, self.logged, one, column, unit)[0]
        return column, sign * units.TO_SI[unit][0]

    def _forces(self, found: MotionMatches) -> None:
        """Find the columns of motors, and of joints without names, by simulation."""
        known = {*self.commands, *found.commands}
        motors = [
            a
            for a in self.robot.actuators
            if a.kind not in (SERVO, SPEED) and a.joint and a.name not in known
        ]
        if not motors:
            return
        lost = [
            a.joint for a in motors if a.joint not in (*self.readings, *found.readings)
        ]
        left = [c for c in self.pool if c not in self._taken(found)]
        several = list(self._settings(lost, left))
        count = len(several) * len(motors) * (len(left) - len(lost)) * 4
        if not several or len(left) < len(lost) + len(motors) or count > _MOST_TRIALS * 4:
            if left:
                named = ", ".join(a.name for a in motors)
                found.open.append(f"which columns are the commands of {named}: too many could be")
            return
        ranked = []
        for readings in several:
            free = [c for c in left if c not in readings.values()]
            score, share, told, rival = self._told(motors, free, readings, found)
            ranked.append((score, share, readings, told, rival))
        ranked.sort(key=lambda one: one[0])
        score, share, readings, told, rival = ranked[0]
        second = min([rival, *(each[0] for each in ranked[1:])])
        if share > _SIMULATED or second < score + _DECISIVE:
            why = f"the best assignment leaves {100 * share:.0f} % of a joint's motion"
            if share <= _SIMULATED:
                why += f", another one hardly more ({np.exp(second - score):.2f} times)"
            found.open.append(f"which columns are the commands of the motors: {why}")
            return
        many = "" if np.isinf(second) else f", another {np.exp(second - score):.1f} times as much"
        found.readings |= readings
        found.commands |= told
        for column in (*readings.values(), *told.values()):
            found.why[column] = f"by simulation, which leaves {100 * share:.0f} %{many}"

    def _settings(self, joints: Sequence[str], left: Sequence[str]) -> Iterator[Assignment]:
        """Columns that joints may have: those that have a velocity beside them, if these are as many."""
        rates = velocities(self.logged, self.pool)
        moved = [c for c in left if c in rates.values()]
        free = moved if len(moved) == len(joints) else [c for c in left if c not in rates]
        if len(free) ** len(joints) > _MOST_TRIALS:
            return
        for order in permutations(free, len(joints)):
            if all(self._reading(j, c) for j, c in zip(joints, order, strict=True)):
                yield dict(zip(joints, order, strict=True))

    def _told(
        self,
        motors: Sequence[Actuator],
        free: Sequence[str],
        readings: Assignment,
        found: MotionMatches,
    ) -> tuple[float, float, Assignment, float]:
        """The commands of motors that leave least: score, worst share, columns, and the next best score."""
        uses = self._known_readings(found)
        uses |= {j: u for j, c in readings.items() if (u := self._reading(j, c))}
        now: dict[str, Use] = {}
        rival = np.inf
        score = self.trials.left(uses, now).score
        for turn in range(3):
            before = dict(now)
            rival = np.inf
            for motor in motors:
                scores = sorted(
                    (self.trials.left(uses, {**now, motor.name: (c, s)}).score, c, s)
                    for c in free
                    for s in self._sizes(motor, c)
                )
                score, column, size = scores[0]
                now[motor.name] = (column, size)
                others = [s for s, c, _ in scores if c != column]
                rival = min([rival, *others])
            if now == before and turn:
                break
        left = self.trials.left(uses, now)
        told = {name: column for name, (column, _) in now.items()}
        if len(set(told.values())) < len(told):
            return np.inf, np.inf, told, np.inf
        return left.score, max(left.share.values()), told, rival

    def _sizes(self, motor: Actuator, column: str) -> list[float]:
        several = [m.factor for m in units.of_force(self.robot, self.logged, motor, column)]
        return [sign * size for size in several for sign in (1, -1)]
