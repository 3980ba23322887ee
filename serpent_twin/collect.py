"""What do motors and markers say while the arm follows random targets?"""

import multiprocessing as mp
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from tqdm import tqdm

from serpent_twin import cli, mjcf, run_folder
from serpent_twin.bus import BusError, MotorBus
from serpent_twin.bus.simulated import SimulatedBus
from serpent_twin.claim import claimed
from serpent_twin.control import joint_p_control, random_targets
from serpent_twin.errors import SerpentError
from serpent_twin.log import SCHEMA_VERSION, Journal
from serpent_twin.mocap import Mocap
from serpent_twin.mocap.simulated import SimulatedMocap
from serpent_twin.parameters import NOMINAL, Parameters
from serpent_twin.provenance import provenance
from serpent_twin.twin import Twin

SETTINGS = "collect.json"


@dataclass(frozen=True)
class Collect:
    """Collect session logs of an arm that follows random joint targets.

    Each session becomes OUT/session_NN.parquet. A run that was interrupted goes on with what is
    missing when the same command is given again, and a larger --sessions adds to a finished run.
    """

    out: Path
    """Folder for the session logs; made if it does not exist."""
    backend: Literal["sim", "real"] = "sim"
    """sim: the twin, as fast as it computes. real: the arm on its motor bus."""
    sessions: int = 23
    """Number of sessions."""
    steps: int = 2100
    """Control steps, that is rows, of each session."""
    rate_hz: float = 4.0
    """Control steps per second."""
    seed: int = 0
    """Seed of targets and noise; session n of seed s is always the same."""
    arm: str = "twin"
    """Name of the arm, stored in the logs."""
    marker_loss: float = 0.0
    """Share of marker readings that the simulated cameras lose."""
    workers: int = 0
    """Processes that simulate side by side; 0 for one a core. The logs do not depend on it."""
    parameters: Parameters = field(default=NOMINAL)
    """The simulated arm's free parameters."""


def collect(config: Collect) -> list[Path]:
    """Collect what is missing of a run; returns the paths of all its sessions."""
    _check(config)
    paths = [session_path(config, n) for n in range(1, config.sessions + 1)]
    with claimed(config.out, SETTINGS, settings(config)):
        missing = [index + 1 for index in run_folder.missing(paths)]
        with _progress(config, len(missing)) as show:
            _simulate_all(config, missing, show)
    return paths


def session_path(config: Collect, session: int) -> Path:
    """Where session 1, 2, … of a run lies."""
    return config.out / f"session_{session:02d}.parquet"


def simulate_session(config: Collect, session: int, tick: Callable[[int], None]) -> Path:
    """Record one session of the twin; `tick` is told the number of rows logged so far."""
    seeds = np.random.SeedSequence(config.seed, spawn_key=(session,)).spawn(3)
    for_targets, for_loads, for_cameras = map(np.random.default_rng, seeds)
    parameters = config.parameters
    bus = SimulatedBus(Twin(parameters=parameters), for_loads, parameters.load_noise)
    cameras = SimulatedMocap(bus.twin, for_cameras, parameters.marker_noise, config.marker_loss)
    targets = random_targets(config.steps, for_targets)
    path = session_path(config, session)
    with bus, Journal(path, metadata(config, session)) as journal:
        rows = record(bus, cameras, targets, parameters.controller_gain, 1 / config.rate_hz)
        for n, row in enumerate(rows, 1):
            journal.append(row)
            tick(n)
        journal.seal()
    run_folder.drop_what_came_again(path)
    return path


def record(
    bus: MotorBus, mocap: Mocap, targets: np.ndarray, gain: float, period: float
) -> Iterator[dict[str, Any]]:
    """Drive a connected arm along joint targets [rad], (steps, 9), one row of the log a step.

    Each step reads motors and markers, sends the P controller's velocities, yields the row, and
    waits for the next period [s]; so a row's command acts between it and the next.
    """
    bus.enable_torque()
    now = 0.0
    for target in targets:
        state, markers = bus.read_state(), mocap.read()
        if state.hardware_error.any():
            tripped = ", ".join(str(i + 1) for i in np.flatnonzero(state.hardware_error))
            raise BusError(
                f"motor {tripped} reported a hardware error at {now:g} s and has switched itself off. "
                "The rows until then are kept; free the arm and reboot the motor, then go on."
            )
        sent = bus.write_velocity(joint_p_control(target, state.position, gain))
        yield {
            "time": now,
            "motor_position": state.position,
            "motor_velocity": state.velocity,
            "motor_load": state.load,
            "motor_velocity_command": sent,
            "joint_target": target,
            "marker": markers,
        }
        now = bus.wait(period)


def metadata(config: Collect, session: int) -> dict[str, Any]:
    """What a session's file says about itself."""
    return {
        "schema_version": SCHEMA_VERSION,
        "backend": config.backend,
        "arm": config.arm,
        "session": session,
        "rate_hz": config.rate_hz,
        "seed": config.seed,
        "config": settings(config),
    } | provenance()


def _check(config: Collect) -> None:
    if config.backend == "real":
        raise SerpentError(
            "not yet: this version has no bus to the real motors. "
            "Use --backend sim; nothing was moved or written."
        )
    for name in ("sessions", "steps"):
        if getattr(config, name) < 1:
            raise SerpentError(f"--{name} is {getattr(config, name)}; give a number of at least 1.")
    if not 0 < config.rate_hz <= 100:
        raise SerpentError(
            f"--rate-hz is {config.rate_hz:g}; give a rate above 0 and up to 100 Hz."
        )
    if not 0 <= config.marker_loss < 1:
        raise SerpentError(f"--marker-loss is {config.marker_loss:g}; give a share within 0 … 1.")
    if config.seed < 0:
        raise SerpentError(f"--seed is {config.seed}; give a number of at least 0.")
    Twin(parameters=config.parameters).substeps(1 / config.rate_hz)


def settings(config: Collect) -> dict[str, Any]:
    """What two runs must share to lie in one folder."""
    free = ("out", "sessions", "workers")
    kept = {key: value for key, value in asdict(config).items() if key not in free}
    return kept | {"model_sha256": mjcf.fingerprint(parameters=config.parameters)}


# Sessions are simulated by processes; a shared array of row counts drives the progress bar.

_counts: Any = None


def _start_worker(counts: Any) -> None:
    """Take the shared counts, and end with the parent however that ends, kill -9 included."""
    global _counts
    _counts = counts
    parent = mp.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def _work(config: Collect, session: int, slot: int) -> Path:
    def tick(rows: int) -> None:
        _counts[slot] = rows
        if _counts[-1]:
            raise SerpentError("stopped, because another session failed.")

    return simulate_session(config, session, tick)


@contextmanager
def _progress(config: Collect, missing: int) -> Iterator[Callable[[int, str], None]]:
    total = missing * config.steps
    with tqdm(total=total, unit="row", disable=not missing, smoothing=0.05) as bar:

        def show(rows: int, sessions: str) -> None:
            bar.set_postfix_str(sessions, refresh=False)
            bar.update(rows - bar.n)

        yield show


def _simulate_all(config: Collect, missing: list[int], show: Callable[[int, str], None]) -> None:
    workers = min(config.workers or os.cpu_count() or 1, len(missing))
    if workers <= 1:
        for done, session in enumerate(missing):
            before = done * config.steps
            label = f"session {session} of {config.sessions}"
            simulate_session(config, session, lambda n, b=before, s=label: show(b + n, s))
        return
    context = mp.get_context("spawn")
    counts = context.Array("q", len(missing) + 1, lock=False)  # the last one stops all workers
    with ProcessPoolExecutor(workers, context, _start_worker, (counts,)) as pool:
        jobs = [pool.submit(_work, config, n, slot) for slot, n in enumerate(missing)]
        try:
            _watch(jobs, counts, missing, config, show)
        except BaseException:
            counts[-1] = 1
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _watch(
    jobs: list[Future[Path]],
    counts: Any,
    missing: list[int],
    config: Collect,
    show: Callable[[int, str], None],
) -> None:
    while not all(job.done() for job in jobs):
        rows = list(counts)[:-1]
        running = [str(n) for n, r in zip(missing, rows, strict=True) if 0 < r < config.steps]
        show(sum(rows), f"session {', '.join(running)} of {config.sessions}" if running else "")
        if any(job.done() and job.exception() for job in jobs):
            break
        time.sleep(0.1)
    jobs = [job for job in jobs if job.done()]
    try:
        for job in jobs:
            job.result()
    except BrokenProcessPool as error:
        raise SerpentError(
            "a simulating process was killed from outside. Every row it logged is kept; "
            "run the same command again to go on."
        ) from error
    show(sum(counts[:-1]), "")


def main(config: Collect) -> None:  # noqa: D103 tyro would print it above the config's own
    paths = collect(config)
    print(f"{len(paths)} sessions of {config.steps} rows in {config.out}")


if __name__ == "__main__":
    cli.run(main)
