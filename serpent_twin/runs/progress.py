"""Show what a long command is doing, since when, and that it is still at work."""

import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from tqdm import tqdm

from serpent_twin.numerals import counted

_ON_SCREEN, _IN_FILE = 1.0, 10.0
"""Longest time between two signs of life [s]"""


class Progress:
    """A line that names the present step, how many were done and how long they took.

    A search does not know how many steps it will take, so no share of them is shown. Of items that are
    counted, the time left is that of those before. The line is written again while a step lasts, with the
    number of simulations that it has made.
    """

    def __init__(self, what: str, simulations: Callable[[], int] = lambda: 0) -> None:
        self.simulations = simulations
        """How many simulations were made so far"""
        self._what, self._steps, self._left = what, 0, ""
        self._began: float | None = None
        self._end = threading.Event()
        self._every = _ON_SCREEN if sys.stderr.isatty() else _IN_FILE
        self._beat = threading.Thread(target=self._live, daemon=True)

    def __enter__(self) -> Self:
        self._bar = tqdm(bar_format="{elapsed}  {desc}", mininterval=0.0)
        self._beat.start()
        self._write()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end.set()
        self._beat.join()
        self._left = ""
        self._what = f"stopped: {self._what}" if kind else "done"
        self._write()
        self._bar.close()

    def step(self, what: str) -> None:
        """Begin a step."""
        self._what, self._left, self._began = what, "", None
        self._steps += 1
        self._write()

    def item(self, what: str, done: int, count: int) -> None:
        """Begin an item of so many, after those that are done."""
        now = time.perf_counter()
        if not done or self._began is None:
            self._began = now
        left = (now - self._began) / done * (count - done) if done else 0.0
        self._what = f"{what}, {done + 1} of {count}"
        self._left = f", about {tqdm.format_interval(left)} left" if done else ""
        self._steps += 1
        self._write()

    def _write(self) -> None:
        made = self.simulations()
        done = f"step {self._steps}" + (f", {counted(made, 'simulation')}" if made else "")
        self._bar.set_description_str(f"{self._what}{self._left} ({done})", refresh=True)

    def _live(self) -> None:
        """Write the line again and again until the end."""
        while not self._end.wait(self._every):
            self._write()
