"""Find what the model of a robot lacks, from its logs; with the twin of a serpentine arm."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from serpent_twin.arm.geometry import ARM, Arm
    from serpent_twin.emulator.simulated_bus import SimulatedBus
    from serpent_twin.errors import SerpentError
    from serpent_twin.estimators import load as load_readout
    from serpent_twin.hardware.dynamixel import DynamixelBus
    from serpent_twin.hardware.motor_bus import MotorBus
    from serpent_twin.interchange.attached import Attached
    from serpent_twin.interchange.attaching import attach
    from serpent_twin.robots import LoggedMachine as Machine
    from serpent_twin.robots import residual, simulate, trace
    from serpent_twin.sessions import Session, read_folder, read_session
    from serpent_twin.sim.twin import Twin
    from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel
    from serpent_twin.sim.twin_model import read as read_twin

__version__ = "0.2.0"
__all__ = [
    "ARM",
    "NOMINAL_TWIN",
    "Arm",
    "Attached",
    "DynamixelBus",
    "Machine",
    "MotorBus",
    "SerpentError",
    "Session",
    "SimulatedBus",
    "Twin",
    "TwinModel",
    "attach",
    "load_readout",
    "read_folder",
    "read_session",
    "read_twin",
    "residual",
    "simulate",
    "trace",
]

_WHERE = {
    "ARM": "arm.geometry:ARM",
    "Arm": "arm.geometry:Arm",
    "Attached": "interchange.attached:Attached",
    "DynamixelBus": "hardware.dynamixel:DynamixelBus",
    "Machine": "robots:LoggedMachine",
    "MotorBus": "hardware.motor_bus:MotorBus",
    "NOMINAL_TWIN": "sim.twin_model:NOMINAL_TWIN",
    "SerpentError": "errors:SerpentError",
    "Session": "sessions:Session",
    "SimulatedBus": "emulator.simulated_bus:SimulatedBus",
    "Twin": "sim.twin:Twin",
    "TwinModel": "sim.twin_model:TwinModel",
    "attach": "interchange.attaching:attach",
    "load_readout": "estimators:load",
    "read_folder": "sessions:read_folder",
    "read_session": "sessions:read_session",
    "read_twin": "sim.twin_model:read",
    "residual": "residual",
    "simulate": "robots:simulate",
    "trace": "trace",
}
"""The module and the name in it of each public name, imported when it is first asked for; modules that are
called as functions, without a name
"""


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, inside = _WHERE[name].partition(":")
    found = importlib.import_module(f"{__name__}.{module}")
    return getattr(found, inside) if inside else found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
