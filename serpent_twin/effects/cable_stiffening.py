"""Let cables' stiffness grow with its stretch."""

from dataclasses import dataclass

import mujoco

from serpent_twin.effects.effect import Effect, parameter
from serpent_twin.effects.strands import chosen, on_strands


@dataclass(frozen=True)
class CableStiffening(Effect):
    """A strand stretched by x pulls with T = k x (1 + b x): a braid's fibres straighten first.

    Source: load-extension curves of braided line, to second order. MJCF expresses all of it: the
    tendon's stiffness polynomial k, k b acts on the stretch beyond the slack. Where a cable's stretch is
    an angle, b is in 1/rad. A tendon of a model that is shortened is softer by as much. Strands of this arm
    stretch by about 0.3 mm, so that b = 500/m makes them 15 % stiffer in the secant.
    """

    rate: float = parameter("1/m", high=1.5e3, typical=500.0)
    """b [1/m]"""
    strand: float = on_strands()
    """Number of the strand or cable that stiffens, as `on_strands` counts them; −1 for all"""

    places = ("tendon",)
    shows_in = "error that grows with tension, less than in proportion"
    confused_with = ("cable_creep", "joint_elasticity")
    model_error = 0.05

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Give the strands' springs their second coefficient."""
        cables = [spec.tendon(self.at)] if self.at else list(spec.tendons)
        for cable, stiffens in zip(cables, chosen(self.strand, len(cables)), strict=True):
            if stiffens:
                cable.stiffness[1] = self.rate * cable.stiffness[0]
