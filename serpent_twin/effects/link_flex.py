"""Let the links bend and twist."""

from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.effects.effect import Effect, parameter

RELAXATION = 0.006
"""Damping over stiffness [s]: nylon's own is less, but it keeps the stiffest link stable at time steps
up to twice this, and a link still follows its load far faster than the arm moves."""
ARMATURE = 2e-3
"""Inertia of a bend [kg m²]: keeps the light half of a link stable between stiff cables, and dry friction
in the joints from creeping; at 0.5 Hz, it carries less than 1 % of the moment of the softest link."""
_STEPS = 3  # of time, in which a link of any machine follows its load
_NO_LENGTH = 1e-9  # [m]
RIGID = 1e-7
"""Compliance of what stands for a rigid link [rad/(N m)]"""


@dataclass(frozen=True)
class LinkFlex(Effect):
    """A link bends about y and z, and twists about its long axis x, by compliance × moment, as if by hinges
    at its middle; in a model that is not the arm's, by hinges at the origin of a body's frame, with the long
    axis through its centre of mass.

    Cables run along the link's axis and neither bend nor twist it. Links 1 … 8 flex; the load of the ninth
    is too light. A link's own mass and marker stay with the half that holds its joint.
    Source: pseudo-rigid-body model (Howell, Compliant Mechanisms, Wiley 2001). MJCF expresses all of it:
    joints of one body turn in sequence, so that the hinges of a link's middle come first in the next
    link's body. A printed nylon link of this size has 0.01 … 0.1 rad/(N m); a round tube twists by 1.4
    times what it bends, an open profile by much more.
    """

    compliance: float = parameter("rad/(N m)", high=0.2, typical=0.03)
    """Compliance of bending [rad/(N m)]"""
    twist: float = parameter("rad/(N m)", high=3.0, typical=0.06, before=0.0)
    """Compliance of twisting [rad/(N m)]"""

    places = ("body",)
    shows_in = "markers that sag more than the joints' angles explain, more so further out"
    confused_with = ("payload",)

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Put three springy hinges before each of joints 2 … 9, half-way from the joint before; or after the
        joints of one body.
        """
        if self.at:
            _bend(spec, self)
            return
        bends, twists = (max(each, RIGID) for each in (self.compliance, self.twist))
        links = [body for body in spec.bodies if body.name.startswith("link")]
        for i, link in enumerate(links[1:], 2):
            length = link.pos[0]
            for about, compliance in (("y", bends), ("z", bends), ("x", twists)):
                hinge = _insert_before(spec, i)
                hinge.name, hinge.axis = f"flex{i - 1}_{about}", [about == a for a in "xyz"]
                hinge.pos = [-length / 2, 0.0, 0.0]
                hinge.stiffness = [1 / compliance, 0, 0]
                hinge.damping = [RELAXATION / compliance, 0, 0]
                hinge.armature = ARMATURE
                hinge.frictionloss, hinge.limited = 0.0, mujoco.mjtLimited.mjLIMITED_FALSE


def _bend(spec: mujoco.MjSpec, flex: LinkFlex) -> None:
    """Let one body bend and twist where its frame is, damped and with inertia enough for the time step."""
    body, model = spec.body(flex.at), spec.compile()
    centre = model.body(flex.at).ipos
    along = (
        centre / size if (size := np.linalg.norm(centre)) > _NO_LENGTH else np.array([0, 0, 1.0])
    )
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    axes = [
        across / np.linalg.norm(across),
        np.cross(along, across / np.linalg.norm(across)),
        along,
    ]
    step = _STEPS * model.opt.timestep
    for n, (axis, wanted) in enumerate(
        zip(axes, (flex.compliance,) * 2 + (flex.twist,), strict=True)
    ):
        stiffness = 1 / max(wanted, RIGID)
        hinge = body.add_joint(name=f"flex of {flex.at} {n + 1}", axis=axis, frictionloss=0.0)
        hinge.type, hinge.limited = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtLimited.mjLIMITED_FALSE
        hinge.stiffness, hinge.damping = [stiffness, 0, 0], [step * stiffness, 0, 0]
        hinge.armature = step**2 * stiffness


def _insert_before(spec: mujoco.MjSpec, i: int) -> mujoco.MjsJoint:
    """A new joint that turns before joint i: the old one, whose name and properties a new one takes."""
    old = spec.joint(f"joint{i}")
    new = spec.body(f"link{i}").add_joint(old.classname, axis=old.axis)
    new.stiffness, new.damping, new.frictionloss = old.stiffness, old.damping, old.frictionloss
    old.name, new.name = "", old.name
    return old
