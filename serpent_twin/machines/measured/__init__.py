"""Share the code of the rigs of other measured machines."""

from serpent_twin.machines.measured.machine import RunMachine
from serpent_twin.machines.measured.recording import KEY, read, read_runs
from serpent_twin.machines.measured.twin_file import MachineTwin, read_twin

__all__ = [
    "KEY",
    "MachineTwin",
    "RunMachine",
    "read",
    "read_runs",
    "read_twin",
]
