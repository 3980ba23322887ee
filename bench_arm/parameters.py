"""Store the parameters that differ between bench arms."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array

STRANDS = 2 * N_JOINTS
"""Strands of the nine joints' cables: + strands of cables 1 … 9, then their − strands."""


@dataclass(frozen=True)
class BenchArm:
    """One built arm. The defaults are a plain one; `draw` makes the ones that exist."""

    strand_stiffness: tuple[float, ...] = (8e3,) * STRANDS
    """Force per stretch beyond the slack [N/m]."""
    strand_slack: tuple[float, ...] = (0.4e-3,) * STRANDS
    """Stretch of the loop from which a strand pulls [m]."""
    strand_damping: float = 0.5
    """Force per stretching speed of a taut strand [N s/m]."""
    joint_friction: tuple[float, ...] = (4e-3,) * N_JOINTS
    """Dry friction of each hinge [N m]."""
    joint_damping: float = 0.015
    """Viscous friction of each hinge [N m s/rad]."""
    bristle_stiffness: float = 40.0
    """Stiffness of a hinge that sticks [N m/rad]: dry friction gives way elastically before it slides."""
    gear_friction: tuple[float, ...] = (0.06,) * N_MOTORS
    """Dry friction of each gearbox, at the horn [N m]."""
    radius_ratio: tuple[float, ...] = (1.0,) * N_JOINTS
    """Winch radius over the radius of the cable's pulleys."""
    marker_offset: tuple[tuple[float, float, float], ...] = ((0.0, 0.0, 0.0),) * N_JOINTS
    """Each marker's misplacement in its link's frame [m]."""
    length_ratio: tuple[float, ...] = (1.0,) * N_JOINTS
    """Each link's length over the drawn one."""
    mass_ratio: tuple[float, ...] = (1.0,) * N_JOINTS
    """Each link's mass over the drawn one."""
    axis_tilt: tuple[tuple[float, float], ...] = ((0.0, 0.0),) * N_JOINTS
    """Angles by which each hinge's axis leans along its link's x, and across both [rad]."""
    camera_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the cameras see the base's origin [m]."""
    camera_turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Rotation vector by which they see the base turned [rad]."""
    armature: float = 0.005
    """Rotor inertia at the horn [kg m²]."""
    velocity_lag: float = 0.03
    """Time constant with which the servo follows a new velocity command [s]."""
    velocity_p: float = 2.0
    """Torque per velocity error [N m s/rad]."""
    velocity_i: float = 20.0
    """Torque per integrated velocity error [N m/rad]."""
    load_noise: float = 0.006
    """Standard deviation of a load reading [fraction of stall torque]."""
    marker_noise: float = 0.4e-3
    """Standard deviation of each marker coordinate [m]."""
    marker_loss: float = 0.002
    """Probability that a marker is lost in a row."""


def draw(rng: np.random.Generator) -> BenchArm:
    """An arm as workshops build them: every number within its tolerance of a common value."""
    # Geometry has its own stream: seeds give the cables, servos and sensors that they gave before.
    (shape,) = rng.spawn(1)
    return BenchArm(
        strand_stiffness=_spread(rng, np.exp(rng.uniform(*np.log([2e3, 2e4]))), 0.15, STRANDS),
        strand_slack=_spread(rng, rng.uniform(0.2e-3, 0.8e-3), 0.20, STRANDS),
        strand_damping=rng.uniform(0.2, 1.0),
        joint_friction=_spread(rng, rng.uniform(2e-3, 8e-3), 0.10, N_JOINTS),
        joint_damping=rng.uniform(0.005, 0.03),
        gear_friction=_spread(rng, rng.uniform(0.03, 0.09), 0.10, N_MOTORS),
        radius_ratio=tuple((1 + 0.003 * rng.standard_normal(N_JOINTS)).tolist()),
        marker_offset=_triples(0.3e-3 * rng.standard_normal((N_JOINTS, 3))),
        length_ratio=tuple((1 + 0.02 * shape.standard_normal(N_JOINTS)).tolist()),
        mass_ratio=tuple((1 + 0.03 * shape.standard_normal(N_JOINTS)).tolist()),
        axis_tilt=tuple((a, b) for a, b in (5e-3 * shape.standard_normal((N_JOINTS, 2))).tolist()),
        camera_shift=_triples(1.5e-3 * shape.standard_normal((1, 3)))[0],
        camera_turn=_triples(3e-3 * shape.standard_normal((1, 3)))[0],
        armature=rng.uniform(0.004, 0.007),
        velocity_lag=rng.uniform(0.020, 0.040),
        velocity_p=rng.uniform(1.5, 3.0),
        velocity_i=rng.uniform(15.0, 30.0),
        load_noise=rng.uniform(0.005, 0.010),
        marker_noise=rng.uniform(0.3e-3, 0.8e-3),
    )


def _spread(rng: np.random.Generator, middle: float, share: float, n: int) -> tuple[float, ...]:
    """Draw n values within ± share of the middle."""
    return tuple((middle * rng.uniform(1 - share, 1 + share, n)).tolist())


def _triples(x: Array) -> tuple[tuple[float, float, float], ...]:
    return tuple((a, b, c) for a, b, c in x.tolist())
