"""Run workers on a Dask cluster."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.extras import requires
from serpent_twin.runs.worker_pool import Pool

PATIENCE = 5.0
"""How long the scheduler and its first worker may take to answer [s]"""


@contextmanager
def cluster(address: str) -> Iterator[Pool]:
    """The workers of a scheduler at tcp://HOST:PORT; more may join, and some leave, at any time.

    The scheduler itself retries a job whose worker died, three times by default. Raises
    SerpentError when no scheduler answers there, or has no worker.
    """
    with requires("cluster", "A cluster", ", here and where the workers are"):
        from distributed import Client, KilledWorker
    client = _connected(Client, address)
    try:
        _require_workers(client, address)
        pool = Pool(
            client.get_executor, lambda: sum(client.nthreads().values()) or 1, (KilledWorker,), 0
        )
        try:
            yield pool
        finally:
            pool.close(wait=False)
    finally:
        client.close(timeout=PATIENCE)


def _connected(client: Any, address: str) -> Any:
    if not re.fullmatch(r"(tcp|tls)://[^/\s]+:\d+", address):
        raise SerpentError(f"--cluster is {address}; write an address such as tcp://HOST:8786.")
    try:
        return client(address, timeout=PATIENCE, set_as_default=False)
    except OSError as error:
        raise SerpentError(
            f"No Dask scheduler answered at {address} within {PATIENCE:g} s. Start one with `dask "
            "scheduler`, give the address that it prints, such as tcp://HOST:8786, or leave --cluster out."
        ) from error


def _require_workers(client: Any, address: str) -> None:
    from distributed import TimeoutError

    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise SerpentError(
            f"The Dask scheduler at {address} has no workers. Start some, one thread each: `dask worker "
            f"{address} --nworkers auto --nthreads 1`."
        ) from error
