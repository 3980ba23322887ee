"""Find where, when and on what the twin's error depends.

`Comparison` holds measured rows beside predicted ones; `analyse` finds, `describe` puts into words, `figures`
draws. `learned` is the last resort: a correction without physics. Called as `serpent_twin.residual(robot)`,
it is `serpent_twin.robots.residual`.
"""

from serpent_twin.callable_module import make_callable
from serpent_twin.residual.comparison import Comparison, join
from serpent_twin.residual.dependence import Dependence, depends_on
from serpent_twin.residual.describe import describe, settling_text
from serpent_twin.residual.findings import Findings, SessionChange, analyse, settled
from serpent_twin.residual.joint_attribution import attribute_to_joints
from serpent_twin.residual.measure import (
    ANGLE,
    ANGULAR_VELOCITY,
    CONTROL,
    FORCE,
    LENGTH,
    LOADS,
    MARKERS,
    MEASURES,
    POSITION,
    TORQUE,
    VELOCITY,
    Measure,
)
from serpent_twin.residual.noise import Noise, expected_distance, measurement_noise
from serpent_twin.residual.size import load_size, marker_size

__all__ = [
    "ANGLE",
    "ANGULAR_VELOCITY",
    "CONTROL",
    "FORCE",
    "LENGTH",
    "LOADS",
    "MARKERS",
    "MEASURES",
    "POSITION",
    "TORQUE",
    "VELOCITY",
    "Comparison",
    "Dependence",
    "Findings",
    "Measure",
    "Noise",
    "SessionChange",
    "analyse",
    "attribute_to_joints",
    "depends_on",
    "describe",
    "expected_distance",
    "join",
    "load_size",
    "marker_size",
    "measurement_noise",
    "settled",
    "settling_text",
]
make_callable(__name__)
