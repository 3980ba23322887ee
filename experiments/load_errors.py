"""State the errors of an arm's loads in a diagnosis as shares of the stall torque."""

from collections.abc import Mapping
from typing import Any

from serpent_twin.arm.geometry import ARM

_STALL = 1e3 * ARM.servo.stall_torque  # [mN m]


def load_errors(diagnosis: Mapping[str, Any]) -> dict[str, float | None]:
    """Errors of the loads by the stage of the twin [% of stall]; None where a stage has none.

    Diagnoses before 0.2.0 state them so.
    """
    if "load_error_percent" in diagnosis:
        return dict(diagnosis["load_error_percent"])
    stages = diagnosis["torque_error_mNm"].items()
    return {stage: None if of is None else 100 * of / _STALL for stage, of in stages}
