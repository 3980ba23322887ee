"""Suggest the next command when a command has ended.

Each function names the command that README's path has next, with the paths of the run that has ended, and
runs that command's own checks first: a step that would be refused is not printed.
"""

from serpent_twin.next_step.of_logs import (
    after_check,
    after_estimate,
    after_follow,
    after_import,
    after_logs,
    after_look,
    after_plan,
    after_recovery,
    after_replay,
    after_sweep,
    after_trace,
    after_training,
    trace,
    without_observer,
)
from serpent_twin.next_step.of_motors import after_device, after_doctor, after_frame, after_zero
from serpent_twin.next_step.words import Words, line, say

__all__ = [
    "Words",
    "after_check",
    "after_device",
    "after_doctor",
    "after_estimate",
    "after_follow",
    "after_frame",
    "after_import",
    "after_logs",
    "after_look",
    "after_plan",
    "after_recovery",
    "after_replay",
    "after_sweep",
    "after_trace",
    "after_training",
    "after_zero",
    "line",
    "say",
    "trace",
    "without_observer",
]
