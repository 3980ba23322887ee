"""How does one arm differ from its drawing, part by part?"""

from dataclasses import dataclass, fields

import numpy as np

from serpent_twin.arm import N_JOINTS, N_MOTORS, Array
from serpent_twin.errors import SerpentError

N_STRANDS = 2 * N_MOTORS

Each = tuple[float, ...]
"""One number for each part."""


@dataclass(frozen=True)
class Tolerances:
    """Deviations of single parts; all zero is the nominal arm. Calibration fits them to logs."""

    strand_stiffness: Each = (0.0,) * N_STRANDS
    """Logarithm of each strand's stiffness over the nominal one [1], in the order of `mjcf.STRANDS`"""
    strand_slack: Each = (0.0,) * N_STRANDS
    """Added to the slack of each strand [m]; below zero in sum, the strand is pre-tensioned"""
    joint_friction: Each = (0.0,) * N_JOINTS
    """Logarithm of each hinge's Coulomb friction over the nominal one [1]"""
    jaw_held: Each = (0.0,)
    """1: the jaw is held still, so that its cable pulls at the arm as the others do; 0: it turns"""
    transition_velocity: Each = (0.0,) * N_JOINTS
    """Logarithm of each hinge's transition velocity over the nominal one [1]"""
    joint_damping: Each = (0.0,) * N_JOINTS
    """Logarithm of each hinge's viscous damping over the nominal one [1]"""
    winch_radius: Each = (0.0,) * N_MOTORS
    """By how much each winch is larger than its cable's other pulleys, as a share [1]"""
    gear_friction: Each = (0.0,) * N_MOTORS
    """Logarithm of each gearbox's friction over the nominal one [1]"""
    marker: Each = (0.0,) * (3 * N_JOINTS)
    """Added to the markers' places in their link frames [m]: x, y, z of marker 1, 2, …"""

    def __post_init__(self) -> None:
        for each in fields(self):
            value, size = getattr(self, each.name), len(each.default)  # type: ignore[arg-type]
            if len(value) != size or not np.isfinite(value).all():
                raise SerpentError(
                    f"the tolerance {each.name} must be {size} finite numbers; got {len(value)} "
                    "numbers or some that are not finite."
                )

    @property
    def marker_offset(self) -> Array:
        """`marker` as an array, (9, 3)."""
        return np.array(self.marker).reshape(N_JOINTS, 3)


EXACT = Tolerances()
"""Every part as drawn."""
