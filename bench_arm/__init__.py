"""Simulate a second arm that shares no physics with the twin, and record its logs.

Rigid bodies, cables, friction, servos and sensors are written from physics in numpy alone; many
arms and sessions run side by side. `python -m bench_arm --help` records from the shell.
"""

from .chain import Chain, Payloads, chain
from .effects import NAMES, NONE, TYPICAL, Effects, inject
from .machine import ArmBatch
from .parameters import BenchArm, draw
from .record import Job, record, record_many
from .sensors import SessionSpec
from .session import simulate

__all__ = [
    "NAMES",
    "NONE",
    "TYPICAL",
    "ArmBatch",
    "BenchArm",
    "Chain",
    "Effects",
    "Job",
    "Payloads",
    "SessionSpec",
    "chain",
    "draw",
    "inject",
    "record",
    "record_many",
    "simulate",
]
