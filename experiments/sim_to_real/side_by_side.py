"""Study arms side by side, each in a worker process with its progress bar."""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import RLock
from typing import Any

from tqdm import tqdm

from experiments.sim_to_real.arm import STEPS, study_arm
from experiments.sim_to_real.twins import Size
from serpent_twin.errors import SerpentError
from serpent_twin.runs.processes import processes
from serpent_twin.runs.worker_pool import execute


def study_all(
    folders: Mapping[str, Path], out: Path, seed: int, size: Size, workers: int
) -> dict[str, Any]:
    """All arms, side by side; one that fails stops none that runs, and all that was done is kept."""
    study, found = partial(_study, folders, out, seed, size), dict[str, Any]()
    with processes(min(workers or os.cpu_count() or 1, len(folders))) as pool:
        given_up = execute([*folders], study, pool, found.__setitem__)
    if given_up:
        raise SerpentError(
            f"the study of {', '.join(given_up)} was given up, because every process that tried it died, "
            "perhaps for want of memory. The same command goes on where it stopped."
        )
    return {name: found[name] for name in folders}


def _study(
    folders: Mapping[str, Path], out: Path, seed: int, size: Size, name: str
) -> dict[str, Any]:
    tqdm.set_lock(RLock())  # a semaphore of the system would be left behind by Ctrl-C
    with progress(name, STEPS, list(folders).index(name)) as on_progress:
        return study_arm(folders[name], out / name, seed, size, on_progress)


@contextmanager
def progress(name: str, steps: int, line: int) -> Iterator[Callable[[str], None]]:
    """A progress bar, and the function that names the step that begins and counts it."""
    with tqdm(total=steps, unit="step", position=line, smoothing=0.1) as bar:

        def on_progress(what: str) -> None:
            bar.set_description_str(f"{name}, {what}", refresh=False)
            bar.update()

        yield on_progress
