"""Wrap the arm as an environment for reinforcement learning.

A dm_control `Environment` over any `MotorBus`: an action is ten motor velocities, an observation is
what the bus reads and the task's target. One step is one control period.
"""

from collections import OrderedDict
from collections.abc import Callable

import numpy as np

from serpent_twin.arm.control import random_targets
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, joint_from_motor
from serpent_twin.arrays import Array
from serpent_twin.command_line.options import RateHz, Seed, Steps, check_arguments
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.extras import requires
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.motor_bus import MotorBus, MotorState
from serpent_twin.hardware.xl430 import POSITION_UNIT, VELOCITY_LIMIT, VELOCITY_UNIT, Words

with requires("env", "The environment"):
    from dm_control.rl import control
    from dm_env import specs

TOP_SPEED = VELOCITY_LIMIT * VELOCITY_UNIT
"""The servo's Velocity Limit [rad/s]."""


class BusPhysics(control.Physics):
    """The arm on a motor bus as dm_control's physics; `open_bus` makes a new bus at each reset.

    A reset closes the old bus, which switches the torque off, and connects anew: the twin
    starts straight and at rest, a real arm stays where it is.
    """

    def __init__(self, open_bus: Callable[[], MotorBus], period: float) -> None:
        self._open_bus, self._period = open_bus, period
        self._bus: MotorBus | None = None
        self._state: MotorState | None = None
        self._time = 0.0

    @property
    def bus(self) -> MotorBus:
        """The connected bus; connects if there is none."""
        if self._bus is None:
            self.reset()
        assert self._bus is not None
        return self._bus

    def reset(self) -> None:
        """Close the bus, if any, and connect, configure and energise a fresh one."""
        self.close()
        self._bus = self._open_bus()
        self._bus.connect()
        self._bus.configure()
        self._bus.enable_torque()
        self._state, self._time = None, 0.0

    def after_reset(self) -> None:
        """Do nothing: a bus is ready once it is reset."""

    def set_control(self, control: Array) -> None:
        """Send goal velocities [rad/s], (10,)."""
        self.bus.write_velocity(control)

    def step(self, n_sub_steps: int = 1) -> None:
        """Let control periods pass."""
        for _ in range(n_sub_steps):
            self._time = self.bus.wait(self._period)
        self._state = None

    def read(self) -> MotorState:
        """All motors now; the bus is asked once a step."""
        self._state = self._state or self.bus.read_state()
        return self._state

    def time(self) -> float:
        """Time on the bus's clock [s]."""
        return self._time

    def timestep(self) -> float:
        """The control period [s]."""
        return self._period

    def close(self) -> None:
        """Switch the torque off and close the bus."""
        if self._bus is not None:
            self._bus.close()
        self._bus = None


class FollowTargets(control.Task):
    """Bring the joints to random targets, as the paper's protocol draws them.

    The reward is minus the mean distance between the targets and the joint angles from the motor
    angles [rad]: it needs nothing but the bus, so it is the same on hardware.
    """

    def __init__(self, rng: np.random.Generator, steps: int) -> None:
        self._rng, self._steps = rng, steps
        self._targets = np.zeros((1, N_JOINTS))
        self._step = 0

    @property
    def target(self) -> Array:
        """The present joint target [rad], (9,)."""
        return self._targets[min(self._step, len(self._targets) - 1)]

    def initialize_episode(self, physics: BusPhysics) -> None:
        """Draw the targets of an episode."""
        self._targets, self._step = random_targets(self._steps, self._rng), 0

    def before_step(self, action: Array, physics: BusPhysics) -> None:
        """Send the action to the motors."""
        physics.set_control(action)

    def after_step(self, physics: BusPhysics) -> None:
        """Go on to the next target."""
        self._step += 1

    def get_observation(self, physics: BusPhysics) -> OrderedDict[str, Array | Words]:
        """What the bus reads, in SI units, and the target."""
        state = physics.read()
        return OrderedDict(
            position=state.position,
            velocity=state.velocity,
            load=state.load,
            voltage=state.voltage,
            temperature=state.temperature,
            hardware_error=state.hardware_error,
            target=self.target.copy(),
        )

    def get_reward(self, physics: BusPhysics) -> float:
        """Minus the mean joint error [rad]."""
        joint = joint_from_motor(physics.read().position[:N_JOINTS])
        return -float(np.abs(self.target - joint).mean())

    def get_termination(self, physics: BusPhysics) -> float | None:
        """The episode ends with the targets, or, as a failure, when a motor has tripped."""
        if physics.read().hardware_error.any():
            return 0.0
        return 1.0 if self._step >= self._steps else None

    def action_spec(self, physics: BusPhysics) -> specs.BoundedArray:
        """Ten motor velocities [rad/s] within the servo's Velocity Limit."""
        return specs.BoundedArray((N_MOTORS,), float, -TOP_SPEED, TOP_SPEED, name="motor_velocity")

    def observation_spec(self, physics: BusPhysics) -> OrderedDict[str, specs.BoundedArray]:
        """Bounds are those of the registers; a position is multi-turn, a register of 32 bits."""
        reach, fastest = 2**31 * POSITION_UNIT, TABLE["velocity_limit"].high * VELOCITY_UNIT
        limits = {
            "position": (N_MOTORS, -reach, reach),
            "velocity": (N_MOTORS, -fastest, fastest),
            "load": (N_MOTORS, -1.0, 1.0),
            "voltage": (N_MOTORS, 0.0, 16.0),
            "temperature": (N_MOTORS, 0.0, 100.0),
            "target": (N_JOINTS, -np.pi, np.pi),
        }
        spec = {k: specs.BoundedArray((n,), float, a, b, name=k) for k, (n, a, b) in limits.items()}
        errors = specs.BoundedArray((N_MOTORS,), np.int64, 0, 255, name="hardware_error")
        return OrderedDict(spec | {"hardware_error": errors})


def make(
    open_bus: Callable[[], MotorBus] = SimulatedBus,
    rate_hz: RateHz = 4.0,
    steps: Steps = 100,
    seed: Seed = 0,
) -> control.Environment:
    """An environment over a bus, by default the simulated one: `env.make().step(action)`."""
    check_arguments(make, rate_hz=rate_hz, steps=steps, seed=seed)
    physics = BusPhysics(open_bus, 1 / rate_hz)
    return control.Environment(physics, FollowTargets(np.random.default_rng(seed), steps))
