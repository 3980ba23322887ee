"""Run worker processes on this machine, one thread each."""

import multiprocessing as mp
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

from serpent_twin.runs.worker_pool import Pool

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def threads() -> int:
    """Threads that simulations of this process may use: OMP_NUM_THREADS, else one a core."""
    told = os.environ.get("OMP_NUM_THREADS", "")
    return int(told) if told.isdecimal() and int(told) else os.cpu_count() or 1


def _nothing() -> None: ...


@contextmanager
def processes(
    count: int, begin: Callable[..., object] = _nothing, given: tuple[Any, ...] = ()
) -> Iterator[Pool]:
    """Spawned processes that end with this one, however it ends, kill -9 included.

    Each calls `begin` first, with the arguments `given`, which may be shared memory of multiprocessing.
    """
    context = mp.get_context("spawn")
    ended, end = context.Pipe(duplex=False)

    def start() -> ProcessPoolExecutor:
        return ProcessPoolExecutor(count, context, _begin, (ended, begin, given))

    with _one_thread_each():
        pool = Pool(start, lambda: count)
        try:
            yield pool
            pool.close(wait=True)
        finally:
            end.close()  # ends processes that are at work
            pool.close(wait=True)
            ended.close()


def _begin(ended: Connection, begin: Callable[..., object], given: tuple[Any, ...]) -> None:
    """Leave Ctrl-C to the parent, and end when its end of the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def follow() -> None:
        ended.poll(None)
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    begin(*given)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started meanwhile compute with one thread: more would be in each other's way."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ |= dict.fromkeys(_ONE_THREAD, "1")
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
