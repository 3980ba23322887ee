"""Simulate the arm's motors behind a serial port that any program can open.

Ten XL430-W250 on a pseudo-terminal, moving the simulated arm. They use Protocol 2.0, so that any program for
DYNAMIXELs works with them unchanged. `running` starts them for a test.
"""

from serpent_twin.emulator.device.child import Running, running

__all__ = ["Running", "running"]
