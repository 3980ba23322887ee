"""Let cables soften while the arm runs."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.effects.effect import Several, parameter
from serpent_twin.effects.strands import OnStrands, on_strands

LEAST = 0.1
"""Share of its stiffness that a strand keeps at least [1]"""


@dataclass(frozen=True)
class StiffnessDrift(OnStrands):
    """Strands soften evenly: k(t) = k (1 − rate t), down to a tenth.

    Warming recovers until the next session, and t counts from the session's start; wear carries
    over, and t includes earlier sessions. At a place of a model, it is the stiffness of a joint's spring,
    or of a tendon with its drives.
    Source: linear term of the modulus in time. Polyethylene loses about 1 % of its modulus per kelvin,
    and cables, pulleys and winches warm by some kelvins to tens of kelvins in an hour of running.
    """

    rate: float = parameter("1/h", high=5.0, typical=0.5)
    """Share of the stiffness lost per hour [1/h]"""
    carries: float = parameter("1", high=1.0, typical=0.0, fitted=False)
    """0: recovers between sessions; 1: carries over"""
    strand: float = on_strands()
    """Number of the strand or cable that softens, as `on_strands` counts them; −1 for all"""

    shows_in = "sag and lag that grow evenly from beginning to end of a session, or of all"
    places = ("joint", "tendon")
    confused_with = ("cable_creep", "clamp_slip")

    @classmethod
    def variants(cls) -> Several:
        """Warming, and wear."""
        return (cls(0.5), cls(0.5, carries=1.0))

    def act(self, moment: Any, memory: None) -> None:
        """Soften the strands."""
        hours = (moment.time + self.carries * moment.prior_runtime) / 3600.0
        left = np.maximum(1.0 - self.rate * hours, LEAST)
        moment.stiffness *= np.where(self.chosen(moment.stiffness.shape[1]), left, 1.0)
