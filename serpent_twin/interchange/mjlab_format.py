"""Write the drives of a twin as actuator configurations of mjlab.

Source: the documentation of mjlab 1.6, mjlab.actuator.
"""

import re

import numpy as np

from serpent_twin.interchange.exported import Exported, Format, Given
from serpent_twin.interchange.joints import JointDrive, configurations

_KINDS = {
    "position": "BuiltinPositionActuatorCfg",
    "velocity": "BuiltinVelocityActuatorCfg",
    "effort": "BuiltinMotorActuatorCfg",
}
"""Configuration class of an actuator in mjlab, by the quantity that it is commanded"""
_UNLIMITED = 1e9  # [N m] of a motor, whose configuration must state a limit
_HEAD = '''"""Actuators of {name} for mjlab: `EntityArticulationInfoCfg(actuators=ACTUATORS)`."""

{notes}
# Springs and inertia are those of the MJCF that `spec_fn` loads: load twin.xml, without its actuators.
# Numbers are in SI units; delays are physics steps of {step:.6g} s.
from mjlab.actuator import (
    BuiltinMotorActuatorCfg,
    BuiltinPositionActuatorCfg,
    BuiltinVelocityActuatorCfg,
)

ACTUATORS = (
{groups})
'''


def _write(given: Given) -> Exported:
    """A Python module with one configuration an actuator."""
    return configurations(given, _HEAD, _group)


def _group(drive: JointDrive, late: int) -> str:
    """One configuration."""
    gains = {
        "position": {"stiffness": drive.stiffness, "damping": drive.damping},
        "velocity": {"damping": drive.damping},
        "effort": {},
    }[drive.told]
    limit = drive.effort_limit if np.isfinite(drive.effort_limit) else None
    values = {
        "target_names_expr": (f"^{re.escape(drive.joint)}$",),
        **gains,
        "effort_limit": _UNLIMITED if limit is None and drive.told == "effort" else limit,
        "armature": drive.armature,
        "frictionloss": drive.friction,
        "viscous_damping": drive.viscous,
        "delay_min_lag": late,
        "delay_max_lag": late,
    }
    lines = "".join(f"        {name}={value!r},\n" for name, value in values.items())
    return f"    {_KINDS[drive.told]}(  # {drive.actuator}\n{lines}    ),\n"


FORMAT = Format("a Python module of mjlab's actuator configurations", _write)
