"""Write the tree of a twin as URDF: inertia of links, axes, limits, damping and friction of joints.

Source: the XML specification of URDF, http://wiki.ros.org/urdf/XML. A link's frame lies at its joint.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from serpent_twin.arrays import Array
from serpent_twin.interchange.exported import Exported, Format, Given, noted
from serpent_twin.interchange.joints import effort_limit
from serpent_twin.machines.model.springs import drives_on, single_joints

_SLIDE = mujoco.mjtJoint.mjJNT_SLIDE
_WORLD = "world"
_UNLIMITED = 1e9
"""Where the model has no limit, and URDF must state one"""


@dataclass(frozen=True)
class PlacedFrame:
    """A frame in another: where it is [m], (3,), and how it is turned."""

    at: Array
    turn: Rotation

    def then(self, further: "PlacedFrame") -> "PlacedFrame":
        """A frame that is stated in this one, in what this one is stated in."""
        return PlacedFrame(self.at + self.turn.apply(further.at), self.turn * further.turn)

    @property
    def inverse(self) -> "PlacedFrame":
        """The other frame in this one."""
        back = self.turn.inv()
        return PlacedFrame(-back.apply(self.at), back)


_HERE = PlacedFrame(np.zeros(3), Rotation.identity())


def _write(given: Given) -> Exported:
    """The tree, a link a body and a joint a degree of freedom."""
    model = given.model
    root, lacks = Element("robot", name=given.name), tuple(_lacks(given))
    SubElement(root, "link", name=_WORLD)
    inside = {0: (_WORLD, _HERE)}
    for body in range(1, model.nbody):
        inside[body] = _add_body(root, model, body, *inside[int(model.body_parentid[body])])
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return Exported(f'<?xml version="1.0"?>\n<!--\n{noted(lacks, " ")}\n-->\n{text}\n', lacks)


def _add_body(
    root: Element, model: mujoco.MjModel, body: int, parent: str, within: PlacedFrame
) -> tuple[str, PlacedFrame]:
    """Add a body with its joints to a parent link, whose body lies in a frame of that link; the body's link,
    and where the body lies in it.
    """
    name = model.body(body).name or f"body{body}"
    first, singles = int(model.body_jntadr[body]), set(single_joints(model).tolist())
    joints = [n for n in range(first, first + int(model.body_jntnum[body])) if n in singles]
    placed = within.then(PlacedFrame(model.body_pos[body], _rotation(model.body_quat[body])))
    if not joints:
        _add_joint(root, f"{name} fixed", "fixed", parent, name, placed)
    for n in joints:
        link = name if n == joints[-1] else f"{name} before {_joint(model, joints, n)}"
        at, ahead = _before_reference(model, n)
        _add_moving(root, model, n, parent, link, placed.then(at))
        parent, placed = link, ahead
        if link != name:
            SubElement(root, "link", name=link)
    lies = placed if joints else _HERE
    _add_inertia(SubElement(root, "link", name=name), model, body, lies)
    return name, lies


def _before_reference(model: mujoco.MjModel, joint: int) -> tuple[PlacedFrame, PlacedFrame]:
    """The frame of a joint at angle 0 in its body, which lies at the joint's reference angle, and the body in
    what the joint moves.
    """
    anchor, axis = model.jnt_pos[joint], model.jnt_axis[joint]
    reference = model.qpos0[model.jnt_qposadr[joint]]
    back = PlacedFrame(-reference * axis, Rotation.identity())
    if model.jnt_type[joint] != _SLIDE:
        back = PlacedFrame(np.zeros(3), Rotation.from_rotvec(-reference * axis))
    ahead = PlacedFrame(-anchor, Rotation.identity())
    return PlacedFrame(anchor, Rotation.identity()).then(back), ahead


def _add_moving(
    root: Element, model: mujoco.MjModel, n: int, parent: str, link: str, at: PlacedFrame
) -> None:
    """Add the joint of a hinge or a slide."""
    limited, dof = bool(model.jnt_limited[n]), int(model.jnt_dofadr[n])
    kind = "prismatic" if model.jnt_type[n] == _SLIDE else "revolute" if limited else "continuous"
    joint = _add_joint(root, model.joint(n).name or f"joint{n}", kind, parent, link, at)
    SubElement(joint, "axis", xyz=_text(model.jnt_axis[n]))
    low, high = model.jnt_range[n] if limited else (-_UNLIMITED, _UNLIMITED)
    ends = {} if kind == "continuous" else {"lower": f"{low:.12g}", "upper": f"{high:.12g}"}
    ends |= {"effort": f"{_effort(model, n):.12g}", "velocity": f"{_UNLIMITED:g}"}
    SubElement(joint, "limit", ends)
    rubs = {"damping": model.dof_damping[dof], "friction": model.dof_frictionloss[dof]}
    SubElement(joint, "dynamics", {name: f"{value:.12g}" for name, value in rubs.items()})


def _add_joint(
    root: Element, name: str, kind: str, parent: str, child: str, at: PlacedFrame
) -> Element:
    joint = SubElement(root, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", xyz=_text(at.at), rpy=_text(at.turn.as_euler("xyz")))
    return joint


def _add_inertia(link: Element, model: mujoco.MjModel, body: int, lies: PlacedFrame) -> None:
    """State mass and inertia of a body that lies somewhere in a link."""
    if not model.body_mass[body]:
        return
    of = PlacedFrame(model.body_ipos[body], _rotation(model.body_iquat[body]))
    at = lies.then(of)
    turn = at.turn.as_matrix()
    tensor = turn @ np.diag(model.body_inertia[body]) @ turn.T
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(at.at), rpy="0 0 0")
    SubElement(inertial, "mass", value=f"{model.body_mass[body]:.12g}")
    named = {f"i{a}{b}": tensor["xyz".index(a), "xyz".index(b)] for a, b in _PAIRS}
    SubElement(inertial, "inertia", {name: f"{value:.12g}" for name, value in named.items()})


_PAIRS = ("xx", "xy", "xz", "yy", "yz", "zz")


def _lacks(given: Given) -> Iterator[str]:
    """Sentences on what URDF cannot express of a twin."""
    model = given.model
    if given.beside:
        yield f"effects that only twin.json has: {', '.join(given.beside)}"
    if model.nu:
        yield f"{model.nu} actuators, their gains and delays: export them by --to isaaclab or mjlab"
    dofs = {
        "inertia of rotors (armature)": (model.dof_armature != 0),
        "damping that is not in proportion to the speed": model.dof_dampingpoly.any(axis=1),
    }
    joints = {
        "springs": (model.jnt_stiffness != 0) | model.jnt_stiffnesspoly.any(axis=1),
        "joints with several degrees of freedom, which are fixed here": ~np.isin(
            np.arange(model.njnt), single_joints(model)
        ),
    }
    for what, which in dofs.items():
        joints[what] = np.isin(np.arange(model.njnt), model.dof_jntid[which])
    for what, which in joints.items():
        if which.any():
            names = (model.joint(int(n)).name or f"joint{n}" for n in np.flatnonzero(which))
            yield f"{what}: {', '.join(names)}"
    if (model.body_jntnum > 1).any():
        yield "several joints of one body: between these are links without mass"
    for count, what in ((model.ntendon, "tendons"), (model.neq, "equalities"), (model.nsensor, "sensors"),
                        (model.ngeom, "shapes: take those of your own URDF")):  # fmt: skip
        if count:
            yield f"{count} {what}"


def _effort(model: mujoco.MjModel, joint: int) -> float:
    """The largest torque at a joint, or as good as no limit."""
    limits = [effort_limit(model, joint, a) for a in drives_on(model, "joint", joint)]
    return float(min(sum(limits), _UNLIMITED)) if limits else _UNLIMITED


def _joint(model: mujoco.MjModel, joints: list[int], n: int) -> str:
    following = joints[joints.index(n) + 1]
    return model.joint(following).name or f"joint{following}"


def _rotation(quat: Array) -> Rotation:
    return Rotation.from_quat(quat, scalar_first=True)


def _text(vector: Array) -> str:
    return " ".join(f"{value:.12g}" for value in np.asarray(vector) + 0.0)


FORMAT = Format("URDF of inertia, axes, damping and friction", _write)
