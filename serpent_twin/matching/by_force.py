"""Match the commands of motors, and columns of families, by simulation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from serpent_twin.matching import by_name, units
from serpent_twin.matching.robot import SERVO, SPEED, Actuator
from serpent_twin.matching.trials import Use
from serpent_twin.matching.unmatched import (
    DECISIVE,
    MOST_TRIALS,
    SIMULATED,
    Assignment,
    MotionMatches,
    Unmatched,
    velocities,
)
from serpent_twin.matching.words import COMMAND, EFFORT, READING


@dataclass(frozen=True, eq=False)
class ForceSearch:
    """A search for the columns of motors by what simulations leave."""

    of: Unmatched

    def forces(self, found: MotionMatches) -> None:
        """Find the columns of motors, and of joints without names, by simulation."""
        known = {*self.of.commands, *found.commands}
        motors = [
            a
            for a in self.of.robot.actuators
            if a.kind not in (SERVO, SPEED) and a.joint and a.name not in known
        ]
        if not motors:
            return
        lost = [a.joint for a in motors if a.joint not in (*self.of.readings, *found.readings)]
        left = [c for c in self.of.pool if c not in self.of.taken(found)]
        several = list(self._settings(lost, left))
        count = len(several) * len(motors) * (len(left) - len(lost)) * 4
        if not several or len(left) < len(lost) + len(motors) or count > MOST_TRIALS * 4:
            if left:
                named = ", ".join(a.name for a in motors)
                found.open.append(f"which columns are the commands of {named}: too many could be")
            return
        ranked = []
        for readings in several:
            free = [c for c in left if c not in readings.values() and self._is_force(c)]
            if len(free) < len(motors):
                continue
            score, share, told, rival = self._told(motors, free, readings, found)
            ranked.append((score, share, readings, told, rival))
        if not ranked:
            return
        ranked.sort(key=lambda one: one[0])
        score, share, readings, told, rival = ranked[0]
        second = min([rival, *(each[0] for each in ranked[1:])])
        if share > SIMULATED or second < score + DECISIVE:
            why = f"the best assignment leaves {100 * share:.0f} % of a joint's motion"
            if share <= SIMULATED:
                why += f", another one hardly more ({np.exp(second - score):.2f} times)"
            found.open.append(f"which columns are the commands of the motors: {why}")
            return
        many = "" if np.isinf(second) else f", another {np.exp(second - score):.1f} times as much"
        found.readings |= readings
        found.commands |= told
        for column in (*readings.values(), *told.values()):
            found.why[column] = f"by simulation, which leaves {100 * share:.0f} %{many}"

    def families(self, found: MotionMatches) -> None:
        """Find which of columns named alike are the commands, and which the readings, by simulation."""
        columns = [self.of.logged.names[c] for c in self.of.pool]
        several = by_name.families(self.of.robot, columns)
        ranked = []
        for read, told in permutations(several, 2):
            uses = {j: u for j, c in read.readings.items() if (u := self.of.reading_of(j, c))}
            if len(uses) == len(read.readings):
                controls = self._controls(uses, told.commands)
                left = self.of.trials.left(uses, controls)
                ranked.append((left.score, max(left.share.values()), read.readings, told.commands))
        ranked.sort(key=lambda one: one[0])
        if not ranked or ranked[0][1] > SIMULATED:
            return
        if len(ranked) > 1 and ranked[1][0] < ranked[0][0] + DECISIVE:
            return
        _, share, found.readings, found.commands = ranked[0]
        for column in (*found.readings.values(), *found.commands.values()):
            found.why[column] = f"by its number, and a simulation that leaves {100 * share:.0f} %"
            found.by_order.add(column)

    def _controls(self, uses: Mapping[str, Use], told: Assignment) -> dict[str, Use]:
        """Columns as controls in their likeliest units."""
        controls: dict[str, Use] = {}
        for each in self.of.robot.actuators:
            column = told[each.name]
            if each.kind not in (SERVO, SPEED):
                controls[each.name] = (column, self._sizes(each, column)[0])
            elif each.joint in uses:
                controls[each.name] = (column, abs(uses[each.joint][1]))
        return controls

    def _is_force(self, column: str) -> bool:
        """Whether a column may be a torque that a motor is told, by its name."""
        about = self.of.logged.names[column]
        return about.quantity in ("", EFFORT) and about.direction != READING

    def _settings(self, joints: Sequence[str], left: Sequence[str]) -> Iterator[Assignment]:
        """Columns that joints may have: those that have a velocity beside them, if these are as many."""
        rates = velocities(self.of.logged, self.of.pool)
        moved = [c for c in left if c in rates.values()]
        free = moved if len(moved) == len(joints) else [c for c in left if c not in rates]
        free = [c for c in free if self.of.logged.names[c].direction != COMMAND]
        if len(free) ** len(joints) > MOST_TRIALS:
            return
        for order in permutations(free, len(joints)):
            if all(self.of.reading_of(j, c) for j, c in zip(joints, order, strict=True)):
                yield dict(zip(joints, order, strict=True))

    def _told(
        self,
        motors: Sequence[Actuator],
        free: Sequence[str],
        readings: Assignment,
        found: MotionMatches,
    ) -> tuple[float, float, Assignment, float]:
        """The commands of motors that leave least: score, worst share, columns, and the next best score."""
        uses = self.of.known_readings(found)
        uses |= {j: u for j, c in readings.items() if (u := self.of.reading_of(j, c))}
        now: dict[str, Use] = {}
        rival = np.inf
        for turn in range(3):
            before = dict(now)
            rival = np.inf
            for motor in motors:
                scores = sorted(
                    (self.of.trials.left(uses, {**now, motor.name: (c, s)}).score, c, s)
                    for c in free
                    for s in self._sizes(motor, c)
                )
                _, column, size = scores[0]
                now[motor.name] = (column, size)
                others = [s for s, c, _ in scores if c != column]
                rival = min([rival, *others])
            if now == before and turn:
                break
        left = self.of.trials.left(uses, now)
        told = {name: column for name, (column, _) in now.items()}
        if len(set(told.values())) < len(told):
            return np.inf, np.inf, told, np.inf
        return left.score, max(left.share.values()), told, rival

    def _sizes(self, motor: Actuator, column: str) -> list[float]:
        several = [m.factor for m in units.of_force(self.of.robot, self.of.logged, motor, column)]
        return [sign * size for size in several for sign in (1, -1)]
