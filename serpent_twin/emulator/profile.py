"""Generate the trajectories that a servo's profiles prescribe.

From ROBOTIS' e-manual of the XL430-W250, "What is the Profile". Positions are in any unit of angle;
velocities and accelerations are in that unit and seconds.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from math import copysign, sqrt


class ProfileType(IntEnum):
    """Type of a profile, as bits 4 and 5 of Moving Status (123) have it."""

    STEP = 0
    RECTANGULAR = 1
    TRIANGULAR = 2
    TRAPEZOIDAL = 3


@dataclass(frozen=True)
class Phase:
    """A stretch of constant acceleration."""

    duration: float
    """[s]"""
    velocity: float
    """Velocity at the phase's beginning"""
    acceleration: float = 0.0

    def after(self, elapsed: float) -> tuple[float, float]:
        """Distance from its beginning, and velocity, after a time [s] within it."""
        speed_up = self.acceleration * elapsed
        return (self.velocity + speed_up / 2) * elapsed, self.velocity + speed_up


@dataclass(frozen=True)
class Profile:
    """A trajectory from `start` over phases to `goal`, from where it continues at velocity `final`."""

    shape: ProfileType
    start: float
    goal: float
    phases: tuple[Phase, ...] = ()
    final: float = 0.0

    @property
    def duration(self) -> float:
        """Time from start to goal [s]."""
        return sum(phase.duration for phase in self.phases)

    def at(self, elapsed: float) -> tuple[float, float]:
        """Position and velocity a time after the start [s]."""
        position = self.start
        for phase in self.phases:
            if elapsed < phase.duration:
                passed, velocity = phase.after(elapsed)
                return position + passed, velocity
            position += phase.after(phase.duration)[0]
            elapsed -= phase.duration
        return self.goal + self.final * elapsed, self.final

    def shifted(self, distance: float) -> "Profile":
        """Shift the trajectory by a distance."""
        return replace(self, start=self.start + distance, goal=self.goal + distance)


def step(goal: float) -> Profile:
    """No profile: the goal is demanded at once."""
    return Profile(ProfileType.STEP, goal, goal)


def by_velocity(
    start: float, velocity: float, goal: float, fastest: float, acceleration: float
) -> Profile:
    """The quickest way from a position and velocity to rest at a goal, no faster than `fastest`.

    Acceleration and deceleration are at most `acceleration`; 0 stands for no limit, as `fastest` 0 does.
    """
    if not fastest:
        return step(goal)
    if not acceleration:
        way = goal - start
        phases = (Phase(abs(way) / fastest, copysign(fastest, way)),) if way else ()
        return Profile(ProfileType.RECTANGULAR, start, goal, phases)
    stop = start + velocity * abs(velocity) / (2 * acceleration)  # if it braked at once
    sense = 1.0 if goal >= stop else -1.0
    way, initial = sense * (goal - start), sense * velocity
    peak = sqrt(max(acceleration * way + initial**2 / 2, 0.0))
    cruise = min(peak, fastest)
    change = cruise - initial
    speeding = Phase(abs(change) / acceleration, velocity, sense * copysign(acceleration, change))
    braking = Phase(cruise / acceleration, sense * cruise, -sense * acceleration)
    left = way - sense * sum(phase.after(phase.duration)[0] for phase in (speeding, braking))
    cruising = Phase(max(left, 0.0) / cruise if cruise else 0.0, sense * cruise)
    shape = ProfileType.TRAPEZOIDAL if peak > fastest else ProfileType.TRIANGULAR
    return Profile(shape, start, goal, (speeding, cruising, braking))


def by_time(start: float, velocity: float, goal: float, total: float, rise: float) -> Profile:
    """A way from a position and velocity to rest at a goal that takes `total` [s]; 0 stands for a step.

    The velocity is ramped up, and down again, within `rise` [s], or half of the total if that is less.
    """
    if not total:
        return step(goal)
    rise = min(rise, total / 2)
    if not rise:
        phases = (Phase(total, (goal - start) / total),)
        return Profile(ProfileType.RECTANGULAR, start, goal, phases)
    cruise = (goal - start - velocity * rise / 2) / (total - rise)
    phases = (
        Phase(rise, velocity, (cruise - velocity) / rise),
        Phase(total - 2 * rise, cruise),
        Phase(rise, cruise, -cruise / rise),
    )
    shape = ProfileType.TRAPEZOIDAL if total > 2 * rise else ProfileType.TRIANGULAR
    return Profile(shape, start, goal, phases)


def ramp(start: float, velocity: float, goal_velocity: float, rise: float) -> Profile:
    """A change of velocity at constant acceleration within `rise` [s]."""
    if not rise:
        return Profile(ProfileType.STEP, start, start, final=goal_velocity)
    change = Phase(rise, velocity, (goal_velocity - velocity) / rise)
    end = start + change.after(rise)[0]
    return Profile(ProfileType.TRAPEZOIDAL, start, end, (change,), goal_velocity)
