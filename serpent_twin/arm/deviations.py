"""Store how the parts of one arm deviate from the nominal arm."""

from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.stored import many, within

N_STRANDS = 2 * N_MOTORS

_Log = Annotated[float, within(-10.0, 10.0)]
"""A part 22,000 times as stiff, or so much less, is of another machine"""
_Slack = Annotated[float, within(-0.2, 0.2, "m")]
"""Beyond that a strand pulls always or never"""
_Share = Annotated[float, within(-0.5, 0.5)]
"""A winch of half the pulleys' radius is another one; one of no radius winds nothing"""
_Offset = Annotated[float, within(-0.1, 0.1, "m")]
"""Most links are 55 mm long"""
Strands = Annotated[tuple[_Log, ...], many(N_STRANDS)]
Joints = Annotated[tuple[_Log, ...], many(N_JOINTS)]
Motors = Annotated[tuple[_Log, ...], many(N_MOTORS)]
"""One logarithm for each."""


@dataclass(frozen=True)
class Deviations:
    """Deviations of single parts; all zero is the nominal arm. Calibration fits them to logs."""

    strand_stiffness: Strands = (0.0,) * N_STRANDS
    """Logarithm of each strand's stiffness over the nominal one [1], in the order of `mjcf.STRANDS`"""
    strand_slack: Annotated[tuple[_Slack, ...], many(N_STRANDS)] = (0.0,) * N_STRANDS
    """Added to the slack of each strand [m]; below zero in sum, the strand is pre-tensioned"""
    joint_friction: Joints = (0.0,) * N_JOINTS
    """Logarithm of each hinge's Coulomb friction over the nominal one [1]"""
    jaw_held: Annotated[tuple[Annotated[float, within(0.0, 1.0)], ...], many(1)] = (0.0,)
    """1: the jaw is held still, so that its cable pulls at the arm as the others do; 0: it turns"""
    transition_velocity: Joints = (0.0,) * N_JOINTS
    """Logarithm of each hinge's transition velocity over the nominal one [1]"""
    joint_damping: Joints = (0.0,) * N_JOINTS
    """Logarithm of each hinge's viscous damping over the nominal one [1]"""
    winch_radius: Annotated[tuple[_Share, ...], many(N_MOTORS)] = (0.0,) * N_MOTORS
    """By how much each winch is larger than its cable's other pulleys, as a share [1]"""
    gear_friction: Motors = (0.0,) * N_MOTORS
    """Logarithm of each gearbox's friction over the nominal one [1]"""
    marker: Annotated[tuple[_Offset, ...], many(3 * N_JOINTS)] = (0.0,) * (3 * N_JOINTS)
    """Added to the markers' places in their link frames [m]: x, y, z of marker 1, 2, …"""

    def __post_init__(self) -> None:
        for each in fields(self):
            value, size = getattr(self, each.name), len(each.default)  # type: ignore[arg-type]
            if len(value) != size or not np.isfinite(value).all():
                raise SerpentError(
                    f"the tolerance {each.name} must be {counted(size, 'finite number')}; got {len(value)} "
                    "numbers or some that are not finite."
                )
        if self.jaw_held[0] not in (0, 1):
            raise SerpentError(
                f"the tolerance jaw_held is {self.jaw_held[0]:g}; it must be 0 or 1."
            )

    @property
    def marker_offset(self) -> Array:
        """`marker` as an array, (9, 3)."""
        return np.array(self.marker).reshape(N_JOINTS, 3)


EXACT = Deviations()
"""Every part as drawn."""
