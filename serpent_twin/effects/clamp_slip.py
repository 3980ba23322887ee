"""Let a cable slip in its screw clamp."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import SMOOTH, parameter
from serpent_twin.effects.strands import OnStrands, on_strands

_AT_ONCE = "it slips at once, so that the strand never pulls harder than its grip"
_PAST = 0.02  # [s] time steps through a measured past: the law is exact for a stretch held over one


@dataclass(frozen=True)
class ClampSlip(OnStrands):
    """Above a tension, the grip, a strand's clamp yields: it lengthens for good by rate (T − grip) dt.

    Ends of cables are clamped by screws, by friction alone; a clamp tightened too little slips like a
    viscoplastic (Bingham) element; one that slips at once is a friction clutch. Clamps are taken as
    tightened anew before each session. At a place of a model, the clamp is of a tendon that drives or a
    spring pull.
    Source: Bingham, An Investigation of the Laws of Plastic Flow, 1916. A strand that slips by half a
    millimetre in a session, of 5 to 10 N, shows clearly.
    """

    rate: float = parameter("m/(N s)", high=1.0, typical=1e-5, limit=_AT_ONCE)
    """[m/(N s)]"""
    grip: float = parameter("N", high=60.0, typical=3.0, default=3.0)
    """[N]"""
    strand: float = on_strands(before=None)
    """Number of the strand or cable whose clamps slip, as `on_strands` counts them; −1 for all"""

    shows_in = "error that jumps or grows when a strand is pulled hard, and stays"
    places = ("tendon",)
    confused_with = ("cable_creep", "stiffness_drift")
    model_error = 0.05
    remembers = True

    def start(self, moment: Any) -> Array:
        """Tight clamps: no elongation [m], (n, 20)."""
        return np.zeros_like(moment.slack)

    def longest_step(self, moment: Any) -> Array | float:
        """A strand held at one length slips to its grip with the time constant 1 / (rate k)."""
        return np.maximum(_PAST, SMOOTH / np.maximum(self.rate * moment.stiffness, 1e-9))

    def act(self, moment: Any, memory: Array) -> None:
        """Lengthen the strands, then let them slip on; exact for a stretch held over the step."""
        moment.slack += memory
        excess = np.maximum(moment.tension - self.grip, 0.0)
        share = -np.expm1(-moment.dt * self.rate * moment.stiffness)
        memory += self.chosen(memory.shape[1]) * share * excess / np.maximum(moment.stiffness, 1e-9)
