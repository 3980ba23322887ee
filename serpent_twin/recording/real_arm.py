"""Tell what is known of the real arm and its cameras before it moves."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.hardware.cameras import Mocap, NoMocap
from serpent_twin.hardware.dynamixel.setup import (
    ArmSetup,
    find_setup,
    is_pseudo_terminal,
    setup_to_run,
)
from serpent_twin.recording.options import Collect


def arm_of(config: Collect) -> ArmSetup:
    """The arm's setup, which must know its port and where the arm is straight."""
    setup = find_setup(config.real.setup, config.real.port)
    if not Path(setup.port).exists():
        raise SerpentError(
            f"there is no port {setup.port}. Check cable and supply, and ls /dev/serial/by-id, or start "
            "python -m serpent_twin.bus.device."
        )
    return setup_to_run(setup)


def settings_of_arm(config: Collect) -> dict[str, Any]:
    """Settings that runs of the same arm, recorded in the same way, share."""
    setup = asdict(arm_of(config))
    kept = ("ids", "direction", "zero", "homing_offset", "drive_mode", "limits")
    return {name: setup[name] for name in kept} | {
        "controller_gain": config.parameters.controller_gain,
        "mocap": config.real.mocap,
        "port_is_pseudo_terminal": is_pseudo_terminal(setup["port"]),
    }


def cameras_of(config: Collect) -> Mocap:
    """The cameras asked for, not yet connected."""
    if config.real.mocap == "none":
        return NoMocap()
    from serpent_twin.hardware.base_frame import Rigid
    from serpent_twin.hardware.natnet_live import NatNetMocap

    return NatNetMocap(config.real.natnet, Rigid.load(config.real.frame))
