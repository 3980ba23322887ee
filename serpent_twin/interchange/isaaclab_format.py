"""Write the drives of a twin as actuator configurations of Isaac Lab.

Source: the documentation of isaaclab.actuators, Isaac Lab 2.3 and 3.0, which both read `effort_limit_sim` of
implicit actuators and `effort_limit` of explicit ones.
"""

import numpy as np

from serpent_twin.interchange.exported import Exported, Format, Given
from serpent_twin.interchange.joints import JointDrive, configurations

_HEAD = '''"""Actuators of {name} for Isaac Lab: `ArticulationCfg(actuators=ACTUATORS, ...)`."""

{notes}
# Numbers are in SI units: N m, rad, s; at slides N, m. Delays are physics steps of {step:.6g} s.
# friction and dynamic_friction are efforts, as Isaac Lab has them since Isaac Sim 5.0.
from isaaclab.actuators import DelayedPDActuatorCfg, ImplicitActuatorCfg

ACTUATORS = {{
{groups}}}
'''


def _write(given: Given) -> Exported:
    """A Python module with one group an actuator."""
    return configurations(given, _HEAD, _group)


def _group(drive: JointDrive, late: int) -> str:
    """One entry of the module's dictionary."""
    delays = {"min_delay": late, "max_delay": late} if late else {}
    limited = {"effort_limit" if late else "effort_limit_sim": drive.effort_limit}
    values = {
        "joint_names_expr": [drive.joint],
        "stiffness": drive.stiffness,
        "damping": drive.damping,
        **(limited if np.isfinite(drive.effort_limit) else {}),
        "armature": drive.armature,
        "friction": drive.friction,
        "dynamic_friction": drive.friction,
        "viscous_friction": drive.viscous,
        **delays,
    }
    kind = "DelayedPDActuatorCfg" if late else "ImplicitActuatorCfg"
    lines = "".join(f"        {name}={value!r},\n" for name, value in values.items())
    return f"    {drive.actuator!r}: {kind}(\n{lines}    ),\n"


FORMAT = Format("a Python module of Isaac Lab's actuator configurations", _write)
