"""Build the arm's MJCF model.

Ten motor hinges, nine arm hinges, the jaw; coordinates in that order. Cables are fixed tendons, which is
exact: constant pulley radii make a loop's stretch linear in the angles, r_j (m_j − q_1 − … − q_j). Each loop
is two tendons, + and −, whose springs pull only. Cable damping is nowhere on the tendons, because MuJoCo's
tendon damping acts on a slack tendon, too. The base frame's +x points down in the world; the sensors'
readings are in the base frame.
"""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from serpent_twin.arm.deviations import EXACT, Deviations
from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS, Arm
from serpent_twin.arm.mjcf_text import add, text, word
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.arrays import Array
from serpent_twin.engine.friction_softness import STICKS
from serpent_twin.extras import requires

if TYPE_CHECKING:
    from serpent_twin.arm.meshes import Part

_PACKAGE = Path(__file__).resolve().parents[1]
MODEL = (_PACKAGE / "model").resolve()
"""The arm as MJCF: the package's data, which in a checkout is a link to its model/"""
IN_CHECKOUT = not MODEL.is_relative_to(_PACKAGE)
TIMESTEP = 0.002  # [s] a quarter of it moves the markers by less than 0.2 mm (tests)
STRANDS = tuple(f"cable{j}_{side}" for j in range(1, N_MOTORS + 1) for side in ("plus", "minus"))
"""Names of the 20 strands: cable 1's + and −, cable 2's + and −, …"""
MOTORS = tuple(f"motor{j}" for j in range(1, N_MOTORS + 1))
JOINTS = tuple(f"joint{i}" for i in range(1, N_JOINTS + 1))

_NEVER = -10.0  # [m] lower end of a strand's dead band, out of reach: a strand does not push
_DRAWN = "Drawing the arm"
_HELD = 1.0
"""Friction [N m] and inertia [kg m²] of a jaw that is held: no motor overcomes them, and through a friction
constraint of a light jaw, which is soft, the cable would creep."""
_HEADER = """ The cable-driven serpentine arm. `python -m serpent_twin.mjcf` writes this file.
  Units: m, kg, s, rad, N. Where each number is from: model/README.md.
  The base frame's +x points down, so the arm hangs; marker sensors speak in the base frame.
  Joint i turns about z (i odd) or y (i even) of its link. Cable j's loop is stretched by
  r_j (motor_j - joint_1 - ... - joint_j): its + strand pulls when that exceeds the slack, its -
  strand when it falls below minus the slack, and a slack strand carries nothing, damping included.
  Motors take two inputs: the goal velocity, and the same integrated, which makes them velocity PI. """


def build(
    arm: Arm = ARM,
    parameters: Parameters = NOMINAL,
    tolerances: Deviations = EXACT,
    drawn: bool = False,
    motors: bool = True,
) -> mujoco.MjSpec:
    """The arm as an `MjSpec`; `drawn` adds meshes, lights and visible cables, and no physics.

    Without `motors` the strands run over the arm's joints alone: the caller shifts their rest
    lengths by what the motors wind (see `prescribed_motion.py`).
    """
    if not drawn:
        document = _document(tolerances.built(arm), parameters, tolerances, motors=motors)
        return mujoco.MjSpec.from_string(text(document))
    with requires("view", _DRAWN):  # trimesh is slow to import, needed here only
        from serpent_twin.arm import meshes, routing, scene

    parts = meshes.parts(arm)
    document = text(_document(tolerances.built(arm), parameters, tolerances, parts))
    spec = mujoco.MjSpec.from_string(document, assets=_mesh_files(parts))
    routing.draw(spec, arm)
    scene.furnish(spec)
    return spec


def write(folder: Path = MODEL, arm: Arm = ARM, parameters: Parameters = NOMINAL) -> list[Path]:
    """Write serpent.xml, scene.xml and the mesh files into `folder`; returns their paths."""
    with requires("view", _DRAWN):
        from serpent_twin.arm import meshes

    parts = meshes.parts(arm)
    files: dict[str, str | bytes] = {
        "serpent.xml": text(_document(arm, parameters, EXACT, parts)),
        "scene.xml": build(arm, parameters, drawn=True).to_xml(),
    }
    files |= {f"assets/{name}": data for name, data in _mesh_files(parts).items()}
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return [folder / name for name in files]


def world_from_base() -> Array:
    """Rotation of the base frame in the world, (3, 3): +x, along the straight arm, points down."""
    return np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def _mesh_files(parts: "list[Part]") -> dict[str, bytes]:
    from trimesh.exchange.stl import export_stl

    return {f"{part.name}.stl": export_stl(part.mesh) for part in parts}


def _document(
    arm: Arm,
    parameters: Parameters,
    tolerances: Deviations = EXACT,
    parts: "list[Part] | None" = None,
    motors: bool = True,
) -> ET.Element:
    root = ET.Element("mujoco", model="serpent")
    root.append(ET.Comment(_HEADER))
    add(root, "compiler", angle="radian", meshdir="assets")
    gravity = world_from_base() @ np.array(arm.gravity)
    option = add(root, "option", timestep=TIMESTEP, integrator="implicitfast", gravity=gravity)
    add(option, "flag", contact="disable")
    _add_defaults(root, arm, parameters)
    _add_assets(root, parts or [])
    bodies = _add_bodies(add(root, "worldbody"), arm, parameters, tolerances, motors)
    for part in parts or []:
        look = {"class": "visual", "mesh": part.name, "rgba": word(part.rgba)}
        add(bodies[part.body], "geom", **look)
    _add_strands(add(root, "tendon"), arm, parameters, tolerances, motors)
    if motors:
        _add_servos(add(root, "actuator"))
    _add_sensors(add(root, "sensor"), motors)
    return root


def _add_defaults(root: ET.Element, arm: Arm, parameters: Parameters) -> None:
    p, servo = parameters, arm.servo
    default = add(root, "default")
    add(default, "joint", type="hinge", solimpfriction=(STICKS, STICKS))
    add(default, "site", size=0.004, group="3")
    motor = add(default, "default", class_="motor")
    add(motor, "joint", axis=(0, 0, 1), armature=servo.armature, frictionloss=p.gear_friction)
    nominal = (servo.voltage, servo.stall_torque, servo.no_load_speed)
    gains = (servo.velocity_i, 0, servo.velocity_p, 0, 0, servo.voltage)
    add(motor, "dcmotor", nominal=nominal, input="pos vel", controller=gains)
    for name, axis, reach, armature in (
        ("odd", (0, 0, 1), arm.joint_range, 0.0),
        ("even", (0, 1, 0), arm.joint_range, 0.0),
        ("jaw", (0, 1, 0), arm.jaw_range, arm.jaw_armature),
    ):
        hinge = add(default, "default", class_=name)
        resist = {"damping": p.joint_damping, "frictionloss": p.joint_friction}
        resist |= {"armature": armature} if armature else {}
        add(hinge, "joint", axis=axis, limited="true", range=(-reach, reach), **resist)
    dead_band = (_NEVER, p.strand_slack)
    strand = add(default, "default", class_="strand")
    add(strand, "tendon", stiffness=p.strand_stiffness, springlength=dead_band)
    visual = add(default, "default", class_="visual")
    add(visual, "geom", type="mesh", contype="0", conaffinity="0", mass="0", group="2")


def _add_assets(root: ET.Element, parts: "list[Part]") -> None:
    if parts:
        asset = add(root, "asset")
        for part in parts:
            add(asset, "mesh", name=part.name, file=f"{part.name}.stl", inertia="shell")


def _add_bodies(
    world: ET.Element, arm: Arm, parameters: Parameters, tolerances: Deviations, motors: bool
) -> dict[str, ET.Element]:
    """All bodies by name: the base with its motors, the chain of links, the jaw."""
    half = np.sqrt(0.5)
    base = add(world, "body", name="base", quat=(half, 0, half, 0))
    size = np.array(arm.robot_size) - [sum(arm.link_length), 0, 0]
    mass = arm.robot_mass - sum(arm.link_mass) - N_MOTORS * arm.horn_mass
    _add_inertial(base, mass, -size[0] / 2, mass / 12 * ((size**2).sum() - size**2))
    add(base, "site", name="base", **_seen_from(arm))
    bodies = {"base": base}
    for j in range(N_MOTORS if motors else 0):
        friction = _off(parameters.gear_friction, tolerances.gear_friction[j], "frictionloss")
        bodies[f"motor{j + 1}"] = _add_motor(base, j, arm, friction)
    link = base
    for i in range(N_JOINTS):
        resist = _resist(parameters, tolerances.joint_friction[i], tolerances.joint_damping[i])
        link = bodies[f"link{i + 1}"] = _add_link(link, i, arm, resist)
    resist = _resist(parameters, *2 * tolerances.jaw_friction)
    if tolerances.jaw_held[0]:
        resist = {"frictionloss": _HELD, "armature": _HELD}
    bodies["jaw"] = _add_jaw(link, arm, resist)
    return bodies


def _resist(nominal: Parameters, friction: float, damping: float) -> dict[str, Any]:
    """A hinge's dry and viscous frictions, where they deviate by these logarithms."""
    dry = _off(nominal.joint_friction, friction, "frictionloss")
    return dry | _off(nominal.joint_damping, damping, "damping")


def _off(nominal: float, logarithm: float, name: str) -> dict[str, Any]:
    """An attribute that overrides the class's, if the part deviates."""
    return {name: nominal * np.exp(logarithm)} if logarithm else {}


def _add_inertial(body: ET.Element, mass: float, centre: float, inertia: Array) -> None:
    add(body, "inertial", pos=(centre, 0, 0), mass=mass, diaginertia=inertia)


def _add_motor(base: ET.Element, j: int, arm: Arm, friction: dict[str, float]) -> ET.Element:
    name, m, r = f"motor{j + 1}", arm.horn_mass, arm.pulley_radius[j]
    horn = add(base, "body", name=name, pos=arm.motor_place[j])
    _add_inertial(horn, m, 0.0, m * r**2 * np.array([0.25, 0.25, 0.5]))
    add(horn, "joint", class_="motor", name=name, **friction)
    return horn


def _seen_from(arm: Arm) -> dict[str, Any]:
    """Attributes of the frame in which cameras see, if that is not the base's."""
    if not any(arm.camera_pose):
        return {}
    turn = arm.camera_turn
    return {"pos": -turn.T @ arm.camera_pose[:3], "xyaxes": turn[:2].ravel()}


def _add_link(parent: ET.Element, i: int, arm: Arm, resist: dict[str, Any]) -> ET.Element:
    link = add(parent, "body", name=f"link{i + 1}", pos=arm.joint_offset[i])
    if i < N_JOINTS - 1:
        _add_inertial(link, arm.link_mass[i], arm.link_length[i] / 2, arm.link_inertia(i))
    else:
        _add_inertial(link, *_without_jaw(arm))
    if any(arm.axis_tilt[2 * i : 2 * i + 2]):
        resist |= {"axis": arm.joint_axes[i]}
    add(link, "joint", class_="even" if i % 2 else "odd", name=f"joint{i + 1}", **resist)
    add(link, "site", name=f"marker{i + 1}", pos=arm.marker[i])
    return link


def _jaw(arm: Arm) -> tuple[float, float, Array]:
    """Mass, length and inertia of the moving jaw, a rod along x."""
    m, size = arm.jaw_mass, arm.link_length[-1] - arm.jaw_joint
    return m, size, m * np.array([1e-5, size**2 / 12 + 1e-5, size**2 / 12 + 1e-5])


def _without_jaw(arm: Arm) -> tuple[float, float, Array]:
    """Mass, centre along x and inertia of link 9, so that with the jaw it has the arm's numbers."""
    m, size, inertia = _jaw(arm)
    whole, middle, at = arm.link_mass[-1], arm.link_length[-1] / 2, arm.jaw_joint + size / 2
    rest = whole - m
    centre = (whole * middle - m * at) / rest
    steiner = m * (at - middle) ** 2 + rest * (centre - middle) ** 2
    return rest, centre, arm.link_inertia(-1) - inertia - steiner * np.array([0.0, 1.0, 1.0])


def _add_jaw(link: ET.Element, arm: Arm, resist: dict[str, Any]) -> ET.Element:
    m, size, inertia = _jaw(arm)
    jaw = add(link, "body", name="jaw", pos=(arm.jaw_joint, 0, 0))
    _add_inertial(jaw, m, size / 2, inertia)
    add(jaw, "joint", class_="jaw", name="jaw", **resist)
    return jaw


def _add_strands(
    tendon: ET.Element, arm: Arm, parameters: Parameters, tolerances: Deviations, motors: bool
) -> None:
    for n, name in enumerate(STRANDS):
        j, sign = n // 2 + 1, 1.0 if name.endswith("plus") else -1.0
        reach = sign * arm.pulley_radius[j - 1]
        off = _off(parameters.strand_stiffness, tolerances.strand_stiffness[n], "stiffness")
        if more := tolerances.strand_slack[n]:
            off |= {"springlength": np.array([_NEVER, parameters.strand_slack + more])}
        strand = add(tendon, "fixed", class_="strand", name=name, **off)
        if motors:
            winch = reach * (1 + tolerances.winch_radius[j - 1])
            add(strand, "joint", joint=f"motor{j}", coef=winch)
        for i in range(1, min(j, N_JOINTS) + 1):
            add(strand, "joint", joint=f"joint{i}", coef=-reach)
        if j == N_MOTORS:
            add(strand, "joint", joint="jaw", coef=-reach)


def _add_servos(actuator: ET.Element) -> None:
    for j in range(1, N_MOTORS + 1):
        add(actuator, "dcmotor", class_="motor", name=f"motor{j}", joint=f"motor{j}")


def _add_sensors(sensor: ET.Element, motors: bool) -> None:
    for kind, reads, of in (
        ("jointpos", "position", "joint"),
        ("jointvel", "velocity", "joint"),
        ("actuatorfrc", "torque", "actuator"),
    ):
        for j in range(1, N_MOTORS + 1 if motors else 1):
            add(sensor, kind, name=f"motor{j}_{reads}", **{of: f"motor{j}"})
    seen = {"objtype": "site", "reftype": "site", "refname": "base"}
    for i in range(1, N_JOINTS + 1):
        add(sensor, "framepos", name=f"marker{i}", objname=f"marker{i}", **seen)
