"""Record many sessions of the twin at once."""

import multiprocessing as mp
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.recording import run_folder
from serpent_twin.recording.loop import NOTHING, Beside, TargetSteering, record
from serpent_twin.recording.options import Collect
from serpent_twin.recording.run_settings import metadata, session_path
from serpent_twin.recording.simulated_arm import SimulatedArm, generators
from serpent_twin.runs.processes import processes
from serpent_twin.sessions import Journal
from serpent_twin.sim import pushes as pushing


def simulate_all(config: Collect, missing: list[int]) -> None:
    """Record the sessions 1, 2, … that are missing, side by side, under one progress bar."""
    with _progress(config, len(missing)) as show:
        _simulate_all(config, missing, show)


def simulated_arm(
    config: Collect, session: int, prior_runtime: float = 0.0
) -> tuple[SimulatedArm, Array]:
    """The simulated arm, which ran for `prior_runtime` before session 1 [s], and the joint targets of one
    session [rad], (steps, 9).
    """
    for_targets, for_loads, for_cameras, for_pushes = generators(config.seed, (session,))
    file = config.simulated()
    prior_runtime += (session - 1) * config.rows / config.rate_hz
    twin, parameters = file.twin(prior_runtime), file.design.parameters
    twin.pushes = config.pushes(for_pushes)
    arm = SimulatedArm.of(twin, parameters, for_loads, for_cameras, config.marker_loss)
    return arm, config.targets(for_targets)


def pushes(config: Collect, arm: SimulatedArm) -> Beside:
    """What a log states of the known forces on the simulated arm."""
    if not config.push:
        return NOTHING
    known = arm.bus.twin.pushes
    return Beside(pushing.COLUMNS, lambda step: pushing.columns(known, step.time))


def simulate_session(config: Collect, session: int, tick: Callable[[int], None]) -> Path:
    """Record one session of the twin; `tick` is given the number of rows logged so far."""
    arm, targets = simulated_arm(config, session)
    path, pushed = session_path(config, session), pushes(config, arm)
    with arm.bus, Journal(path, metadata(config, session), pushed.columns) as journal:
        steering, period = TargetSteering(targets, arm.gain), 1 / config.rate_hz
        rows = record(arm.bus, arm.cameras, steering, period, pushed.further)
        for n, row in enumerate(rows, 1):
            journal.append(row)
            tick(n)
        journal.seal()
    run_folder.drop_what_came_again(path)
    return path


# Sessions are simulated by processes; a shared array of row counts drives the progress bar.

_counts: Any = None


def _take_counts(counts: Any) -> None:
    global _counts
    _counts = counts


def _work(config: Collect, job: tuple[int, int]) -> Path:
    """Simulate a session, given the place of its count and its number."""
    slot, session = job

    def tick(rows: int) -> None:
        _counts[slot] = rows
        if _counts[-1]:
            raise SerpentError("stopped, because another session failed.")

    return simulate_session(config, session, tick)


@contextmanager
def _progress(config: Collect, missing: int) -> Iterator[Callable[[int, str], None]]:
    total = missing * config.rows
    with tqdm(total=total, unit="row", disable=not missing, smoothing=0.05) as bar:

        def show(rows: int, sessions: str) -> None:
            bar.set_postfix_str(sessions, refresh=False)
            bar.update(rows - bar.n)

        yield show


def _simulate_all(config: Collect, missing: list[int], show: Callable[[int, str], None]) -> None:
    workers = min(config.workers or os.cpu_count() or 1, len(missing))
    if workers <= 1:
        for done, session in enumerate(missing):
            before = done * config.rows
            label = f"session {session} of {config.sessions}"
            simulate_session(config, session, lambda n, b=before, s=label: show(b + n, s))
        return
    # the last count stops all workers
    counts = mp.get_context("spawn").Array("q", len(missing) + 1, lock=False)
    with processes(workers, _take_counts, (counts,)) as pool:
        work = partial(_work, config)
        jobs = [pool.submit(work, each) for each in enumerate(missing)]
        try:
            _watch(jobs, counts, missing, config, show)
        except BaseException:
            counts[-1] = 1
            for job in jobs:
                job.cancel()
            wait(jobs)  # sessions at work close their journals
            raise


def _watch(
    jobs: list[Future[Path]],
    counts: Any,
    missing: list[int],
    config: Collect,
    show: Callable[[int, str], None],
) -> None:
    length = config.rows
    while not all(job.done() for job in jobs):
        rows = list(counts)[:-1]
        running = [str(n) for n, r in zip(missing, rows, strict=True) if 0 < r < length]
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
