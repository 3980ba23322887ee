"""Let loaded cables creep, and recover."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import SMOOTH, parameter
from serpent_twin.effects.strands import OnStrands, on_strands


@dataclass(frozen=True)
class CableCreep(OnStrands):
    """A strand's rest length grows by e with de/dt = (f x − e) / τ, x its elastic stretch.

    That is the standard linear solid: the strand's spring k in series with a spring k/f and a damper
    τ k/f side by side. Under a constant tension the strand is longer by the share f in the end.
    Source: Zener, Elasticity and Anelasticity of Metals, 1948; polyethylene line creeps by 0.1 … 1 of
    its elastic stretch within minutes. At a place of a model, it is the rest length of a tendon, which its
    drives or its spring pull, or the rest of a joint's drive, which yields either way.
    """

    fraction: float = parameter("1", high=3.0, typical=0.3)
    """f [1]"""
    time: float = parameter("s", low=5.0, high=1000.0, typical=60.0, default=60.0)
    """τ [s]"""
    strand: float = on_strands()
    """Number of the strand or cable that creeps, as `on_strands` counts them; −1 for all"""

    shows_in = "error that builds up over a minute while a pose is held, and recovers"
    places = ("tendon", "actuator")
    confused_with = ("cable_stiffening", "clamp_slip", "stiffness_drift")
    model_error = 0.05
    remembers = True

    def start(self, moment: Any) -> Array:
        """Strands that have rested: no elongation [m], (n, 20)."""
        return np.zeros_like(moment.slack)

    def longest_step(self, moment: Any) -> Array | float:
        """A strand held at one length relaxes with the time constant τ / (1 + f)."""
        return SMOOTH * self.time / (1.0 + self.fraction)

    def act(self, moment: Any, memory: Array) -> None:
        """Lengthen the strands, then let them creep on; exact for a stretch held over the step."""
        moment.slack += memory
        stretch = moment.stretch if self.at else np.maximum(moment.stretch, 0.0)
        goal = self.fraction * self.chosen(stretch.shape[1]) * stretch
        memory += (goal - memory) * -np.expm1(-moment.dt / self.time)
