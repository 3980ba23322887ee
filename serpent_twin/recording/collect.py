"""Record motors and markers while the arm follows random targets."""

from pathlib import Path

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.recording import run_folder
from serpent_twin.recording.motion import read as read_motion
from serpent_twin.recording.options import Collect
from serpent_twin.recording.run_settings import session_path, settings
from serpent_twin.runs.run_lock import claimed

SETTINGS = "collect.json"


def collect(config: Collect) -> list[Path]:
    """Collect what is missing of a run; returns the paths of all its sessions."""
    check(config)
    paths = [session_path(config, n) for n in range(1, config.sessions + 1)]
    with claimed(config.out, SETTINGS, settings(config)):
        missing = [index + 1 for index in run_folder.missing(paths)]
        if config.backend == "real":
            from serpent_twin.recording import lost_markers, real  # only if its port is meant

            real.record_all(config, missing)
            lost_markers.say(paths)
        else:
            from serpent_twin.recording import simulated

            if note := config.simulated().note:
                print(note)
            simulated.simulate_all(config, missing)
    return paths


def check(config: Collect) -> None:
    """Refuse what cannot be collected, before anything is written or moves."""
    if config.motion:
        _check_motion(config, config.motion)
    if config.backend == "sim":
        config.pushes(np.random.default_rng(0))
        config.simulated().twin().substeps(1 / config.rate_hz)
    else:
        from serpent_twin.recording.real_arm import arm_of, cameras_of

        arm_of(config)
        cameras_of(config)


def _check_motion(config: Collect, path: Path) -> None:
    """Refuse a motion that was planned for another rate or another arm."""
    motion = read_motion(path)
    if motion.rate_hz != config.rate_hz:
        raise SerpentError(
            f"{path} was planned for {motion.rate_hz:g} control steps per second, not {config.rate_hz:g}: "
            f"give --rate-hz {motion.rate_hz:g}."
        )
    arm = motion.about.get("arm")
    if arm and arm != config.arm_name:
        raise SerpentError(
            f"{path} was planned for the arm {arm}, not for {config.arm_name}: a trace would not take its "
            f"logs together with those that it was planned from. Give --arm {arm} if this is that arm."
        )
