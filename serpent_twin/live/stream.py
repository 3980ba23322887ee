"""Pass rows to rerun without delaying the control loop.

A process of its own draws them. The loop hands each row to a queue, a thread takes them from there to the
process, and what it cannot take in time waits in the queue.
"""

import contextlib
import multiprocessing as mp
import queue
import threading
from multiprocessing.connection import Connection
from typing import Self

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.force_filter import FeltForce
from serpent_twin.live.follower import LATENCY, MARKERS
from serpent_twin.live.sample import Page, Sample
from serpent_twin.recording.loop import Row

START = 60.0
"""Longest time that the drawing process may take to start [s]"""


class RerunStream:
    """Rows on their way to rerun; a context manager. A failure of the drawing never stops the arm."""

    def __init__(self, page: Page) -> None:
        self._page, self._gone = page, False
        self._rows: queue.SimpleQueue[Sample | None] = queue.SimpleQueue()

    def see(self, row: Row, covariance: Array, felt: FeltForce | None = None) -> None:
        """Queue a logged row, with the covariance of its estimate [m²], (9, 3, 3), and the force that was
        felt; returns at once.
        """
        if not self._gone:
            estimated = np.array([row[name] for name in MARKERS]).reshape(N_JOINTS, 3)
            sample = Sample(
                time=row["time"],
                motor=row["motor_position"],
                load=row["motor_load"],
                measured=row["marker"],
                estimated=estimated,
                covariance=covariance,
                latency_ms=row[LATENCY],
                force=felt.force if felt else np.full(3, np.nan),
                force_covariance=felt.covariance if felt else np.full((3, 3), np.nan),
                link=felt.link if felt else 1,
                touched=bool(felt and felt.touched),
            )
            self._rows.put(sample)

    def __enter__(self) -> Self:
        context = mp.get_context("spawn")
        self._pipe, its_end = context.Pipe()
        self._process = context.Process(target=_draw, args=(its_end, self._page), daemon=True)
        self._process.start()
        its_end.close()  # so that the process sees the end of this one, whatever it is
        if said := self._answer(START):
            self._process.kill()
            raise SerpentError(said)
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._rows.put(None)
        self._thread.join()
        if said := self._answer(None):
            print(said)
        self._process.join()

    def _send(self) -> None:
        with contextlib.suppress(OSError):  # the process is gone, its answer says why
            while (sample := self._rows.get()) is not None:
                self._pipe.send(sample)
            self._pipe.send(None)
        self._gone = True

    def _answer(self, patience: float | None) -> str:
        """The next text from the process, empty if all is well."""
        try:
            if self._pipe.poll(patience):
                return self._pipe.recv()
            return (
                f"drawing for rerun did not start within {patience:g} s. Leave it out: --no-record."
            )
        except (EOFError, OSError):
            return "the process that draws for rerun ended early: the recording is not whole."


def _draw(rows: Connection, page: Page) -> None:
    from serpent_twin.live.draw import draw  # and rerun with it, in that process alone

    draw(rows, page)
