"""Let a joint move freely inside a gap between it and its drive."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class FreePlay(Effect):
    """A drive that sets a position pushes its joint only where their distance is more than half a gap.

    The drive is a spring of the servo's stiffness without mass: it follows its command through the gap at
    once, and takes up gap / 2 at either flank. Unlike backlash that friction holds, the joint falls, swings
    and knocks inside the gap.
    Source: the dead zone of a clearance, Nordin and Gutman, Automatica 38, 2002.
    """

    gap: float = parameter("rad", high=0.3, typical=0.02)
    """Gap from one flank to the other [rad]"""

    places = ("actuator",)
    shows_in = "joints that fall or swing a little where their load changes sign"
    confused_with = ("gear_backlash", "joint_elasticity")
    model_error = 0.05  # flanks give and bounce

    def act(self, moment: Any, memory: None) -> None:
        """Take up the gap."""
        half = np.asarray(self.gap) / 2
        stretch = moment.free_stretch - moment.slack
        moment.slack = moment.slack + np.clip(stretch, -half, half)
