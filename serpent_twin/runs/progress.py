"""Show what a long command is doing, since when, and that it is still at work."""

import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from tqdm import tqdm

from serpent_twin.numerals import counted

_ON_SCREEN, _IN_FILE = 1.0, 10.0
"""Longest time between two signs of life [s]"""


@dataclass(frozen=True)
class _Items:
    """Items that are counted, of which one is under way."""

    began: float
    """When the first began [s]"""
    present: float
    """When the present one began [s]"""
    done: int
    count: int

    def left(self, now: float) -> float:
        """Time left [s], by the mean of those that are done, or longer if the present one takes longer."""
        each = max((self.present - self.began) / self.done, (now - self.began) / (self.done + 1))
        return max(each * (self.count - self.done) - (now - self.present), 0.0)


class Progress:
    """A line that names the present step, how many were done and how long they took.

    A search does not know how many steps it will take, so no share of them is shown. Of items that are
    counted, the time left is that of those before. The line is written again while a step lasts, with the
    number of simulations that it has made.
    """

    def __init__(self, what: str, simulations: Callable[[], int] = lambda: 0) -> None:
        self.simulations = simulations
        """How many simulations were made so far"""
        self._what, self._steps = what, 0
        self._items: _Items | None = None
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
        self._items = None
        self._what = f"stopped: {self._what}" if kind else "done"
        self._write()
        self._bar.close()

    def step(self, what: str) -> None:
        """Begin a step."""
        self._what, self._items = what, None
        self._steps += 1
        self._write()

    def item(self, what: str, done: int, count: int) -> None:
        """Begin an item of so many, after those that are done."""
        now = time.perf_counter()
        began = self._items.began if self._items and done else now
        self._what = f"{what}, {done + 1} of {count}"
        self._items = _Items(began, now, done, count)
        self._steps += 1
        self._write()

    def say(self, text: str) -> None:
        """Print a line for the user above the line that is written again."""
        tqdm.write(text, file=sys.stdout)
        sys.stdout.flush()

    def _write(self) -> None:
        made = self.simulations()
        left = self._items.left(time.perf_counter()) if self._items and self._items.done else None
        said = "" if left is None else f", about {tqdm.format_interval(left)} left"
        done = f"step {self._steps}" + (f", {counted(made, 'simulation')}" if made else "")
        self._bar.set_description_str(f"{self._what}{said} ({done})", refresh=True)

    def _live(self) -> None:
        """Write the line again and again until the end."""
        while not self._end.wait(self._every):
            self._write()
