"""Record a session of the real arm."""

import contextlib
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np
from tqdm import tqdm

from serpent_twin.hardware.dynamixel.bus import DynamixelBus
from serpent_twin.hardware.dynamixel.setup import (
    ArmSetup,
    is_pseudo_terminal,
)
from serpent_twin.recording import lost_markers, run_folder
from serpent_twin.recording.ending import loop_times, refuse_slow, sealed, stopped_by_signals
from serpent_twin.recording.loop import NOTHING, Beside, Steering, Step, TargetSteering, record
from serpent_twin.recording.options import Collect
from serpent_twin.recording.real_arm import arm_of, cameras_of
from serpent_twin.recording.run_settings import metadata, session_path
from serpent_twin.recording.simulated_arm import generators
from serpent_twin.recording.sunken import bring_back
from serpent_twin.sessions import Journal

FURTHER = ("motor1_tick_ms", "recoveries")
"""Columns of every real log: motor 1's own clock, and what the bus overcame since the row before."""
FURTHER_OF_CAMERAS = ("camera_time", "marker_age")
MOST_EVENTS = 200
"""How many of the faults overcome are listed one by one in a log's metadata; all are counted."""

Show = Callable[[int, str], None]


def record_all(
    config: Collect, missing: list[int], beside: Beside = NOTHING, steering: Steering | None = None
) -> None:
    """Record the sessions 1, 2, … that are missing, one after the other; without a steering, the arm follows
    the config's targets.
    """
    setup = arm_of(config)
    if is_pseudo_terminal(setup.port):
        print(f"{setup.port} is a pseudo-terminal: the motors on it are simulated.")
    total = len(missing) * config.rows
    with stopped_by_signals(), tqdm(total=total, unit="row", disable=not missing) as bar:
        for session in missing:

            def show(rows: int, state: str, session: int = session) -> None:
                bar.set_postfix_str(
                    f"session {session} of {config.sessions}, {state}", refresh=False
                )
                bar.update(rows)

            record_session(config, setup, session, show, beside, steering)


def record_session(
    config: Collect,
    setup: ArmSetup,
    session: int,
    show: Show,
    beside: Beside = NOTHING,
    steering: Steering | None = None,
) -> None:
    """Record one session; however it ends, its rows are sealed, and its metadata state why it ended."""
    path = session_path(config, session)
    bus, cameras, watch = DynamixelBus(setup), cameras_of(config), lost_markers.Watch()
    of_bus = FURTHER + (FURTHER_OF_CAMERAS if config.real.mocap != "none" else ())
    beside = Beside(of_bus, _further(bus, of_bus)).and_then(beside)
    gain, period = config.parameters.controller_gain, 1 / config.rate_hz
    if steering is None:
        for_targets, *_ = generators(config.seed, (session,))
        steering = TargetSteering(config.targets(for_targets), gain)
    times: list[float] = []

    def account() -> dict[str, Any]:
        loop = loop_times(np.array(times), period, bus.missed)
        told = {"loop": loop, "bus": _account(bus)}
        if config.real.mocap != "none":
            told |= {"cameras": dict(cameras.account()), lost_markers.KEY: watch.account()}
        beside.end(told)
        return told

    about = metadata(config, session) | _about(config, setup) | dict(beside.about)
    with (
        sealed(path, about, beside.columns, account) as journal,
        cameras,
        bus,
        _kept_on_disk(journal),
    ):
        bring_back(bus, gain, period)
        for row in record(bus, cameras, steering, period, beside.further):
            journal.append(row)
            times.append(row["time"])
            beside.see(row)
            watch.see(row["time"], row["marker"])
            lost = watch.state() if config.real.mocap != "none" else ""
            show(1, _state(times, period, bus) + lost)
            refuse_slow(times, period)
    run_folder.drop_what_came_again(path)


@contextmanager
def _kept_on_disk(journal: Journal) -> Iterator[None]:
    """Force the journal to the disk every second, beside the loop: a slow disk stops no motor."""
    done = threading.Event()

    def keep() -> None:
        while not done.wait(1.0):
            with contextlib.suppress(OSError):  # then the next row says so
                journal.sync()

    thread = threading.Thread(target=keep, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _state(times: list[float], period: float, bus: DynamixelBus) -> str:
    jitter = abs(times[-1] - times[-2] - period) if len(times) > 1 else 0.0
    return (
        f"jitter {jitter * 1e3:.1f} ms, missed {bus.missed}, "
        f"recovered {sum(bus.recovery.counts.values())}"
    )


def _further(bus: DynamixelBus, names: tuple[str, ...]) -> Callable[[Step], dict[str, float]]:
    told = 0

    def columns(step: Step) -> dict[str, float]:
        nonlocal told
        known, told = told, sum(bus.recovery.counts.values())
        values = {
            "motor1_tick_ms": float(step.state.registers.realtime_tick[0]),
            "recoveries": float(told - known),
            "camera_time": step.frame.camera_time,
            "marker_age": step.frame.age,
        }
        return {name: values[name] for name in names}

    return columns


def _about(config: Collect, setup: ArmSetup) -> dict[str, Any]:
    described = asdict(setup) | {"path": str(setup.path)}
    return {
        "markers": config.real.mocap,
        "setup": described,
        "port_is_pseudo_terminal": is_pseudo_terminal(setup.port),
    }


def _account(bus: DynamixelBus) -> dict[str, Any]:
    return {
        "lockstep": bus.lockstep,
        "recoveries": dict(bus.recovery.counts),
        "events": bus.recovery.events[:MOST_EVENTS],
        "answers": dict(bus.wire.counts),
    }
