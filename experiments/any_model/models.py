"""List models of others, whose logs are made here: of dm_control's suite, and Kinova's six-joint arm.

They are read where dm_control is installed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import dm_control
import mujoco
import numpy as np

from serpent_twin.machines.model.masses import settle_total_mass

_SUITE = Path(dm_control.__file__).parent / "suite"
_KINOVA = Path(dm_control.__file__).parent / "third_party" / "kinova"
_NO_CONTACTS = mujoco.mjtDisableBit.mjDSBL_CONTACT


@dataclass(frozen=True)
class PublicModel:
    """A model, how its machine is driven, and what may be wrong with the model."""

    spec: Callable[[], mujoco.MjSpec]
    """Anew at each call"""
    middle: tuple[float, ...]
    """Joint positions about which the machine moves [rad]"""
    swing: float
    """How far they move [rad]"""
    drives: Mapping[str, str]
    """The actuators' joints"""
    gain: float
    """Gain of the feedback that moves motors, from an angle to a control [1/rad]; 0: position servos follow
    the goals themselves
    """
    faults: Mapping[str, float]
    """Strengths of effects at places, one of which each machine has, in SI units"""
    accidents: Mapping[str, float] = field(default_factory=dict)
    """Strengths of what no effect of the catalogue describes, likewise"""
    planar: bool = False
    """Whether nothing can move along y"""
    torques: Mapping[str, float] = field(default_factory=dict)
    """Strengths of what machines lack whose logs hold torques, of the catalogue and of none, likewise"""


def _suite(name: str) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_file(str(_SUITE / f"{name}.xml"))
    spec.option.disableflags |= int(_NO_CONTACTS)
    return spec


def _leg() -> mujoco.MjSpec:
    """The hind leg of the cheetah, whose torso is held."""
    spec = _suite("cheetah")
    for joint in list(spec.body("torso").joints):
        spec.delete(joint)
    spec.delete(spec.body("fthigh"))
    spec.delete(spec.sensors[0])
    settle_total_mass(spec)
    return spec


def _six_joints() -> mujoco.MjSpec:
    """Kinova's Jaco, with a position servo at each joint; what its meshes weigh is written as numbers."""
    spec = mujoco.MjSpec.from_file(str(_KINOVA / "jaco_arm.xml"))
    model = spec.compile()
    for body in spec.bodies[1:]:
        n = model.body(body.name).id
        body.explicitinertial = True
        body.mass, body.ipos = model.body_mass[n], model.body_ipos[n]
        body.iquat, body.inertia = model.body_iquat[n], np.maximum(model.body_inertia[n], 1e-9)
    for thing in [*spec.geoms, *spec.meshes, *spec.excludes]:
        spec.delete(thing)
    for n in range(1, 7):
        servo = spec.add_actuator(name=f"servo_{n}", target=f"joint_{n}")
        servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
        servo.gaintype, servo.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        servo.gainprm[0], servo.biasprm[1], servo.biasprm[2] = _SERVO, -_SERVO, -_BRAKE
    return spec


_SERVO, _BRAKE = 1000.0, 80.0  # [N m/rad], [N m s/rad]
MODELS: Mapping[str, PublicModel] = {
    "pendulum": PublicModel(
        lambda: _suite("pendulum"), (np.pi,), 1.0, {"torque": "hinge"}, 4.0,
        {"hinge_friction@hinge": 0.15, "joint_elasticity@hinge": 0.3, "torque_saturation@torque": 0.5,
         "command_delay": 0.03},
        {"soft_stop@hinge": 2.0},
        torques={"hinge_friction@hinge": 0.15, "joint_elasticity@hinge": 0.3, "gear_friction@hinge": 0.2,
                 "soft_stop@hinge": 2.0},
    ),
    "acrobot": PublicModel(
        lambda: _suite("acrobot"), (np.pi, 0.0), 1.0, {"elbow": "elbow"}, 4.0,
        {"hinge_friction@elbow": 0.3, "joint_elasticity@shoulder": 3.0, "command_delay": 0.03,
         "constant_force@lower_arm": 1.5},
        {"sticking_joint@elbow": 0.6},
        planar=True,
        torques={"hinge_friction@elbow": 0.3, "joint_elasticity@shoulder": 3.0, "rotor_inertia@elbow": 0.05,
                 "sticking_joint@elbow": 0.6},
    ),
    "reacher": PublicModel(
        lambda: _suite("reacher"), (0.0, 0.0), 1.0, {"shoulder": "shoulder", "wrist": "wrist"}, 0.5,
        {"hinge_friction@wrist": 0.002, "joint_elasticity@shoulder": 0.02, "servo_lag@wrist": 0.04,
         "sensor_delay@shoulder": 0.03},
        {"soft_stop@wrist": 0.1},
        torques={"hinge_friction@wrist": 0.002, "joint_elasticity@shoulder": 0.02,
                 "joint_stiffening@wrist": 0.02, "soft_stop@wrist": 0.1},
    ),
    "leg": PublicModel(
        _leg, (0.0, 0.0, 0.0), 0.4, {name: name for name in ("bthigh", "bshin", "bfoot")}, 1.0,
        {"hinge_friction@bshin": 6.0, "payload@bfoot": 1.5, "joint_stiffening@bthigh": 6000.0,
         "constant_force@bfoot": 15.0},
        {"sticking_joint@bshin": 12.0, "swinging_force@bfoot": 15.0},
        planar=True,
        torques={"hinge_friction@bshin": 3.0, "gear_friction@bthigh": 0.2, "joint_stiffening@bthigh": 6000.0,
                 "constant_force@bfoot": 15.0},
    ),
    "six_joints": PublicModel(
        _six_joints, (0.0, np.pi, np.pi, 0.0, 0.5, 0.0), 0.5,
        {f"servo_{n}": f"joint_{n}" for n in range(1, 7)}, 0.0,
        {"hinge_friction@joint_4": 3.0, "gear_backlash@servo_2": 0.02, "constant_force@b_5": 12.0,
         "gravity": 1.5},
        {"swinging_force@b_5": 12.0, "sticking_joint@joint_3": 8.0, "encoder_wave@joint_2": 0.01},
        torques={"hinge_friction@joint_4": 0.5, "gear_friction@joint_2": 0.2, "constant_force@b_5": 6.0,
                 "rotor_inertia@joint_5": 0.1},
    ),
}  # fmt: skip
"""Models by name"""
