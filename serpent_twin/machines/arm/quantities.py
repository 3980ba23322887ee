"""State the coordinates of the arm's fit as a data sheet would: strands in kN/m and mm, hinges in mN m."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.machines.arm.vector import Vector
from serpent_twin.machines.machine import Quantity
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

_JAW = 5  # the gripper's cable is of another make, and hardly moves
_SIGNS = {"plus": "+", "minus": "−"}
_MILLI = 1e3


@dataclass(frozen=True)
class _Kind:
    """Numbers of one block of the vector."""

    name: str
    """With a place for the part"""
    parts: Sequence[str]
    unit: str
    per_si: float
    """Such units in one of SI"""
    scale: float = 0.0
    """SI per unit of the coordinate, of a winch and a link as a share of its size; 0 for a logarithm"""
    tolerance: float = float("nan")
    """Of parts as built: of a logarithm, else in the unit"""
    alike: bool = True
    """Whether parts are judged by their median, not by what is declared"""


def _strand(name: str) -> str:
    motor, sign = name.removeprefix("cable").split("_")
    return f"{motor}{_SIGNS[sign]}"


_STRANDS = [_strand(name) for name in mjcf.STRANDS]
_MOTORS = [str(j) for j in range(1, N_MOTORS + 1)]
_HINGES = ["all joints", *(f"joint {i}" for i in range(1, N_JOINTS + 1))]
_PLACES = [f"{i}, {axis} in its link's frame" for i in range(1, N_JOINTS + 1) for axis in "xyz"]
_LINKS = [str(i) for i in range(1, N_JOINTS + 1)]
_LEANS = [f"{i}, {way}" for i in _LINKS for way in ("along its link", "across")]
_KINDS: Mapping[str, _Kind] = {
    "stiffness": _Kind("strand stiffness {}", _STRANDS, "kN/m", 1 / _MILLI, tolerance=0.15),
    "slack": _Kind("strand slack {}", _STRANDS, "mm", _MILLI, 1e-3, tolerance=0.2),
    "winch": _Kind(
        "winch radius, motor {}", _MOTORS, "mm", _MILLI, 1e-2, tolerance=0.1, alike=False
    ),
    "friction": _Kind("hinge friction, {}", _HINGES, "mN m", _MILLI, tolerance=0.3),
    "transition": _Kind("transition velocity, {}", _HINGES, "mrad/s", _MILLI, tolerance=0.7),
    "damping": _Kind("hinge damping, {}", _HINGES, "mN m s/rad", _MILLI, tolerance=0.5),
    "jaw": _Kind("friction of the {}", ["jaw"], "mN m", _MILLI, tolerance=1.5, alike=False),
    "gear": _Kind("gear friction, motor {}", _MOTORS, "mN m", _MILLI, tolerance=0.3),
    "marker": _Kind("place of marker {}", _PLACES, "mm", _MILLI, 1e-3, tolerance=1.0, alike=False),
    "length": _Kind(
        "length of link {}", _LINKS[:-1], "mm", _MILLI, 1e-2, tolerance=1.1, alike=False
    ),
    "mass": _Kind("mass of link {}", _LINKS, "g", _MILLI, tolerance=0.03, alike=False),
    "axis": _Kind("lean of axis {}", _LEANS, "mrad", _MILLI, 1e-3, tolerance=6.0, alike=False),
    "camera_shift": _Kind("cameras along {}", "xyz", "mm", _MILLI, 1e-3, 2.0, alike=False),
    "camera_turn": _Kind("cameras about {}", "xyz", "mrad", _MILLI, 1e-3, 5.0, alike=False),
}
"""Tolerances are assumed: 0.1 mm of printed parts, 1 mm of markers, 2 % of lengths, the
rest as parts of one kind differ"""


def quantities(of: Vector) -> tuple[Quantity, ...]:
    """One for each coordinate of a vector."""
    start, nominal = _si(of.start), _si(NOMINAL_TWIN)
    found = []
    for block, names in of.names.items():
        kind = _KINDS[block]
        shares = {"winch": of.start.arm.pulley_radius, "length": of.start.arm.link_length[:-1]}
        by = kind.scale * kind.per_si * np.array(shares.get(block, 1.0))
        scales = np.broadcast_to(by, len(kind.parts))
        for k, part in enumerate(kind.parts):
            together = (names[0], names[k]) if kind.parts is _HINGES and k else (names[k],)
            found.append(
                Quantity(
                    kind.name.format(part),
                    kind.unit,
                    float(kind.per_si * start[block][k]),
                    float(scales[k]),
                    together,
                    float(kind.per_si * nominal[block][k]),
                    kind.tolerance * (_JAW if part.startswith(str(N_MOTORS)) else 1),
                    block if kind.alike else "",
                )
            )
    return tuple(found)


def _si(design: TwinModel) -> dict[str, Array]:
    """The numbers of each block; of hinges, the common part first."""
    p, t, built = design.parameters, design.tolerances, design.built

    def hinges(common: float, each: Sequence[float]) -> Array:
        return common * np.exp(np.r_[0.0, each])

    return {
        "stiffness": p.strand_stiffness * np.exp(t.strand_stiffness),
        "slack": p.strand_slack + np.array(t.strand_slack),
        "winch": np.array(design.arm.pulley_radius) * (1 + np.array(t.winch_radius)),
        "friction": hinges(p.joint_friction, t.joint_friction),
        "transition": hinges(p.transition_velocity, t.transition_velocity),
        "damping": hinges(p.joint_damping, t.joint_damping),
        "jaw": p.joint_friction * np.exp(t.jaw_friction),
        "gear": design.gear_friction,
        "marker": built.markers_in_links.ravel(),
        "length": np.array(built.link_length[:-1]),
        "mass": np.array(built.link_mass),
        "axis": np.array(built.axis_tilt),
        "camera_shift": np.array(built.camera_pose[:3]),
        "camera_turn": np.array(built.camera_pose[3:]),
    }
