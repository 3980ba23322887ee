"""Build the trunk's MJCF model."""

from collections.abc import Sequence

import mujoco
import numpy as np
import scipy

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, edit
from serpent_twin.engine.friction_softness import STICKS
from serpent_twin.machines.trunk.shape import CHANNEL, DISKS, ENDS_AT, Shape

TIME_STEP = 0.01
"""[s] Half of it changes the tip by 0.5 mm"""
_PIECES = 4  # of a segment; six change the tip by 0.3 mm
_ARMATURE = 3e-4  # [kg m²] keeps the light pieces between stiff cables stable; 1e-3 changes the tip by 0.3 mm
_STIFFNESS = 6e3  # [N/m] of a cable: makes the trunk weigh some 1 … 2 kg
_SPIN = 1e-6  # [kg m²] of a piece about its own middle
_HANGS = np.array(
    [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
)  # x down, y and z the logs' x and z
CABLES = tuple(f"cable{m}_{side}" for m in range(1, 7) for side in ("plus", "minus"))


def spec(shape: Shape, effects: Sequence[Effect]) -> mujoco.MjSpec:
    """A hose as a chain of springy universal joints; twelve cables through channels in three disks.

    No force is known: all are in the unit in which a cable has the stiffness below. Effects give masses in
    units of the trunk's own, which its weight multiplies.
    """
    model = mujoco.MjSpec()
    model.option.gravity, model.option.timestep = [0, -9.81, 0], TIME_STEP
    model.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    base = model.worldbody.add_body(name="base", pos=shape["base"])
    about_x, about_z = shape["tilt"]
    turn = scipy.spatial.transform.Rotation.from_rotvec(
        [about_x, 0.0, about_z]
    ) * scipy.spatial.transform.Rotation.from_matrix(_HANGS)
    base.quat = turn.as_quat(scalar_first=True)
    channels = _channels(shape["direction"])
    _holes(base, "base", 0.0, channels)
    body, gap = base, 0.0
    for disk in DISKS:
        length = float(shape["length"][disk - 1]) / _PIECES
        for _ in range(_PIECES):
            body = _piece(model, body, gap + length / 2, length, shape)
            gap = length / 2
        _holes(body, f"disk{disk}", gap, channels)
        at = shape["disk"].reshape(3, 3)[disk - 1]
        body.add_site(name=f"marker{disk}", pos=at + [gap, 0, 0])
        model.add_sensor(
            name=f"marker{disk}",
            type=mujoco.mjtSensor.mjSENS_FRAMEPOS,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=f"marker{disk}",
        )
    _weigh(model, shape, body, gap)
    _pull(model, shape)
    edit(model, effects)
    for each in model.bodies:
        each.mass *= float(shape["weight"][0])
        each.inertia *= float(shape["weight"][0])
    return model


def _channels(direction: Array) -> Array:
    """Where each cable passes a disk, (12, 3) [m]: on the motor's side, and on the other."""
    both = np.repeat(direction, 2) + np.tile([0.0, np.pi], len(direction))
    return CHANNEL * np.stack([np.zeros(12), np.cos(both), np.sin(both)], axis=1)


def _holes(body: mujoco.MjsBody, disk: str, at: float, channels: Array) -> None:
    for name, hole in zip(CABLES, channels, strict=True):
        body.add_site(name=f"{name}_{disk}", pos=hole + [at, 0, 0])


def _piece(
    model: mujoco.MjSpec, above: mujoco.MjsBody, at: float, length: float, shape: Shape
) -> mujoco.MjsBody:
    """The next piece of hose, which bends in its middle."""
    n = sum(body.name.startswith("link") for body in model.bodies) + 1
    piece = above.add_body(name=f"link{n}", pos=[at, 0, 0])
    stiffness = float(shape["hose"][0]) / length
    for axis in ("y", "z"):
        joint = piece.add_joint(name=f"joint{n}_{axis}", axis=[0, axis == "y", axis == "z"])
        joint.stiffness[0], joint.damping[0] = stiffness, stiffness * float(shape["settles"][0])
        joint.armature = _ARMATURE
        joint.solimp_friction[:2] = STICKS  # so that dry friction holds it still
    return piece


def _weigh(model: mujoco.MjSpec, shape: Shape, last: mujoco.MjsBody, end: float) -> None:
    """The hose's mass along its length, and what sits at its end: 1 kg in all."""
    pieces = [body for body in model.bodies if body.name.startswith("link")]
    share = float(shape["end"][0])
    for n, piece in enumerate(pieces):
        length = shape["length"][n // _PIECES] / _PIECES
        _mass(piece, float(length / shape["length"].sum() / (1 + share)))
    tip = last.add_body(name="end", pos=[end, 0, 0])
    _mass(tip, share / (1 + share))


def _mass(body: mujoco.MjsBody, mass: float) -> None:
    """Put a mass into a body's origin; without ipos, MuJoCo 3.17 puts it elsewhere."""
    body.mass, body.ipos, body.inertia = mass, [0, 0, 0], [_SPIN] * 3
    body.explicitinertial = True


def _pull(model: mujoco.MjSpec, shape: Shape) -> None:
    """Cables from the base to the disk where they end; slack where they are longer than that."""
    for n, name in enumerate(CABLES):
        ends_at = ENDS_AT[n // 2]
        cable = model.add_tendon(name=name)
        for disk in ("base", *(f"disk{k}" for k in DISKS if k <= ends_at)):
            cable.wrap_site(f"{name}_{disk}")
        cable.stiffness[0], cable.damping[0] = _STIFFNESS, _STIFFNESS * shape["rubs"][0]
        rest = float(shape["length"][:ends_at].sum() - shape["pulled"][n // 2])
        cable.springlength = [0.0, rest]
