"""Say what turned winches, other commands and shifted markers do to what is seen of the trunk.

The trunk follows its cables within a fraction of a second, so that a change shows, to first order, in the
same row: what a constant one does there once all has settled. Goals that move fast, and late cameras, are
left to the simulation of what is found.
"""

from collections.abc import Callable, Sequence

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import ACTUATOR_COMMAND, HANDLES, POSITIONS, Law
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.places import PlaceResponse, PlacesInRow, with_more
from serpent_twin.machines.trunk.motion import CHANGED, PLACES
from serpent_twin.tables.segments import Segments

_STEP = 0.05
"""[rad] by which a winch is turned: a twentieth of its range, and more than dry friction takes up; shifts [m]
of markers are linear
"""
_SEEN = 15
"""Of what is simulated, disks and servos; torques and goals follow"""


def at_places(
    simulate: Callable[[Sequence[ParameterVector], Segments], Array],
    point: ParameterVector,
    pieces: Segments,
) -> PlacesInRow:
    """By differences: all changes are simulated side by side, to disks, servos, torques and goals,
    (D, S, T, 27). The seconds before each window settle what it begins with.
    """
    laws = [Law(name, place) for name in CHANGED for place in PLACES[HANDLES[name].kind]]
    each = [(law, axis) for law in laws for axis in range(HANDLES[law.handle].components)]
    usual, *there = simulate([point, *(with_more(point, *one, _STEP) for one in each)], pieces)
    change = np.nan_to_num((np.array(there) - usual)[..., :_SEEN]) / _STEP
    responses = [
        PlaceResponse(law.handle, law.place, change[[law == of for of, _ in each]]) for law in laws
    ]
    return PlacesInRow(_readings(usual, pieces), responses)


def _readings(usual: Array, pieces: Segments) -> dict[tuple[str, str], Array]:
    """What laws may follow, (S, T), where disks, servos, torques and goals are (S, T, 27)."""
    disk, servo, torque, goal = np.split(usual, [9, 15, 21], axis=-1)
    of_motors = {
        "motor_angle": servo,
        "motor_velocity": np.gradient(servo, axis=1) / pieces.period[:, None, None],
        "horn_torque": torque,
        ACTUATOR_COMMAND: goal,
    }
    readings = {
        (name, motor): values[..., m]
        for name, values in of_motors.items()
        for m, motor in enumerate(PLACES["actuator"])
    }
    for k, where in enumerate(PLACES["body"]):
        for axis, name in enumerate(POSITIONS):
            readings[name, where] = disk[..., 3 * k + axis]
    return {**readings, ("time", "session"): pieces.time}
