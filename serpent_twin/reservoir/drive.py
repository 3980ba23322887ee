"""Command independent inputs, and simulate the response of joints and motors.

Nine inputs, uniform on [−1, 1] and new in every command period, set the nine joints' targets. The motors go
from the coupled angles of one set of targets to those of the next, each at its constant velocity within a
share of the period, and hold; the arm is read at the end of the hold. So the motors' angles hold the present
inputs alone, and all memory is the body's. Inputs that set velocities are unsuitable: angles would be sums
over all past inputs, memory without a body, and would drift out of range.
"""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.control import on_stiff_cables
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.limits import Limits
from serpent_twin.sim.many_twins import TIMESTEP, PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.twin_model import TwinModel

MOVING = 0.8
"""Share of a command period in which the motors move"""
LEAST_TIMESTEP = 5e-4
"""[s]; strands stiffer than about 1.9e6 N/m would need less, and their simulation becomes unstable."""
LONGEST = 0.01
"""[s]; on soft strands poses at the ends of holds differ from those of the finest steps by about 3 % of
their spread, loads by a tenth of a percent of the stall torque."""
LIMITS = Limits()
LONGER = 0.9
"""Share of the longest time step to request: steps may be longer than requested by up to 1 / 0.9"""


@dataclass(frozen=True, eq=False)
class HeldResponse:
    """Response in B stretches of K command periods, read at the end of each hold."""

    motor_angle: Array
    """[rad], (B, K, 10)"""
    load: Array
    """Fraction of the stall torque, without the gears' friction, (B, K, 10)"""
    joint_angle: Array
    """[rad], (B, K, 9)"""
    marker: Array
    """[m], (B, K, 9, 3)"""


def check(rate: float, amplitude: float) -> None:
    """Raise SerpentError if targets of ± an amplitude [rad], new ones at a rate [Hz], are not safe to
    command.
    """
    if not 0 < rate <= 100:
        raise SerpentError(f"The rate is {rate:g} Hz; give one above 0 and up to 100.")
    if not 0 < amplitude <= LIMITS.joint_angle:
        raise SerpentError(
            f"The amplitude is {amplitude:g} rad; give one above 0 and up to {LIMITS.joint_angle:.3f}, "
            "within which joints are safe."
        )
    # From one end of all ranges to the other, motor 9 turns by 2 · 9 amplitudes.
    velocity = 2 * N_JOINTS * amplitude * rate / MOVING
    if velocity > LIMITS.velocity:
        less = LIMITS.velocity / velocity
        raise SerpentError(
            f"Targets of ± {amplitude:g} rad at {rate:g} Hz may ask {velocity:.1f} rad/s of motor 9, and "
            f"its limit is {LIMITS.velocity:.2f}: give at most {less * amplitude:.4f} rad, or at most "
            f"{less * rate:.3g} Hz."
        )


def drive(design: TwinModel, targets: Array, rate: float) -> HeldResponse:
    """Response of a twin model to joint targets [rad], (B, K + 1, 9), at a rate [Hz].

    A stretch begins at rest at its first targets. Raises SerpentError when the simulation gives up.
    """
    timestep = steady_timestep(design.parameters.strand_stiffness, TIMESTEP, LONGEST)
    motors = motors_of(targets, rate)
    motion = PrescribedMotion(motors, targets[:, 0])
    # The faster solver changes the ends of holds by less than the time step does.
    did = impose([design], motion, LONGER * timestep, nthread=1, hastened=True)
    if did.unstable.any():
        raise SerpentError(
            f"the twin's simulation became unstable at time steps of {timestep * 1e3:.2g} ms."
        )
    held = slice(3, None, 2)
    return HeldResponse(
        motors.angle[:, held],
        did.load[0, :, held],
        did.joint_angle[0, :, held],
        did.marker[0, :, held],
    )


def steady_timestep(stiffness: float, nominal: float, longest: float) -> float:
    """The time step [s] that suits strands [N/m] as the nominal one suits the nominal strands.

    The fastest oscillation's frequency goes with the root of the stiffness.
    """
    softer = np.sqrt(NOMINAL.strand_stiffness / stiffness) if stiffness else np.inf
    return max(LEAST_TIMESTEP, min(longest, nominal * float(softer)))


def motors_of(targets: Array, rate: float) -> MotorTrajectory:
    """Motors on their way along joint targets [rad], (B, K + 1, 9): the ends of each move and each hold,
    (B, 2 K + 2).

    Rows 1, 3, 5, … end holds; the first hold is there because `impose` takes its time steps from the
    median interval between rows.
    """
    B, count, _ = targets.shape
    step = np.arange(count - 1)[:, None]
    hold = (1 - MOVING) / rate
    ends = np.hstack([step + MOVING, step + 1.0]).ravel() / rate
    time = hold + np.concatenate([[-hold, 0.0], ends])
    at = np.concatenate([[0, 0], np.repeat(np.arange(1, count), 2)])
    motor = on_stiff_cables(targets)[:, at]
    return MotorTrajectory(np.tile(time, (B, 1)), motor, np.zeros_like(motor))
