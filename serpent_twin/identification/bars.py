"""Say how large an error may be before it is unexplained, without regard to how large it is.

A bar that rises with the error would pass any error. The bar is what a twin that lacks nothing would
leave: the noise of the measurement, at the start too, and what a fit to logs of such noise leaves uncertain.
What looks like noise from row to row, the jitter, may raise it only as far as no pose of the machine explains
it; what a twin of the machine left before that was changed may raise it, as no change explains that; and
what the laws of its effects neglect.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.uncertainty import drawn
from serpent_twin.identification.neglected import neglected
from serpent_twin.machines.case import Case
from serpent_twin.residual.noise import Noise, expected_distance

BEYOND = 2.0
"""Times the bar, above which an error is unexplained in any case; and times the measurement's noise, up to
which an error widens what the parameters of a complete twin may be"""
_DRAWS = 4  # of twins that the data cannot distinguish


@dataclass(frozen=True)
class Bars:
    """Mean errors of the pose that a twin which lacks nothing may have, in its measure's unit."""

    camera_noise: float
    """Error by the measurement's noise alone: what no pose of the machine explains"""
    complete_twin: float
    """Error with the noise in the start, and parameters as uncertain as fits to such noise are"""
    jitter: float
    """Error by the part of the residual that changes from row to row like noise; not capped"""
    before_change: float = 0.0
    """What the twin left of the machine before that was changed; 0 without such a twin"""

    neglected: float = 0.0
    """What the effects that were found may neglect, each a share of what it changes"""

    @property
    def bar(self) -> float:
        """The error that is compared: the largest of a complete twin's, the capped jitter, what the twin left
        before a change, and what its effects neglect.
        """
        capped = float(np.fmin(self.jitter, self.camera_noise))
        several = [self.complete_twin, capped, self.before_change, self.neglected]
        return float(np.nanmax(several))

    def numbers(self, unit: str) -> Mapping[str, Any]:
        """Entries of diagnosis.json."""
        several = ("complete_twin", "before_change", "neglected")
        held = next((name for name in several if self.bar == getattr(self, name)), "jitter")
        names = ("camera_noise", "jitter", *several, "bar")
        each = {name: getattr(self, name) for name in names}
        return {f"{name}_{unit}": value for name, value in each.items()} | {"held": held}


def noise_alone(case: Case[Any], pieces: Any) -> float:
    """Mean error of the pose by the measurement's noise alone, in its measure's unit."""
    measure = case.machine.outputs[0].measure
    std = np.atleast_1d(case.machine.pose_noise(pieces))
    return measure.scale * float(np.mean(expected_distance(std, measure.dimension)))


def bars(
    case: Case[Any],
    found: Fit,
    error: float,
    training: Any,
    held_out: Any,
    noise: Noise,
    rng: np.random.Generator,
    wider: float = 1.0,
) -> Bars:
    """The bars for a fitted twin that makes a mean error on held-out segments, whose standard errors are made
    so many times `wider`.
    """
    camera = noise_alone(case, held_out)
    share = wider * min(1.0, BEYOND * camera / error) if error > 0 else wider
    roughly = case.coarse_step([found.point])  # enough for what differs between twins
    alike = drawn(case, found, training, rng, _DRAWS, share, roughly)
    complete = case.expected(found.point, alike, held_out, rng)
    left = error * float(np.sqrt(neglected(case, found)))
    return Bars(camera, complete, noise.mean_jitter, case.machine.error_before_change, left)
