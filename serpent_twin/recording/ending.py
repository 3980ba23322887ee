"""End the recording of a session: whole, stopped, or because its loop does not keep its rate."""

import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.dynamixel.shutdown import STOPPING, uninterrupted
from serpent_twin.numerals import counted
from serpent_twin.sessions import Journal
from serpent_twin.sessions.parquet import RATE_TOLERANCE

_ROWS, _LAST = 50, 1000
"""Rows between two checks of the rate, and how many of the last ones each looks at"""


@contextmanager
def sealed(
    path: Path,
    metadata: Mapping[str, Any],
    further: Sequence[str],
    account: Callable[[], Mapping[str, Any]],
) -> Iterator[Journal]:
    """A journal that is sealed however the block ends; why it ended joins its metadata, and `account`.

    One without rows is deleted.
    """
    ended: dict[str, Any] = {"complete": False}
    with Journal(path, metadata, further) as journal:
        try:
            yield journal
            ended = {"complete": True}
        except BaseException as error:
            ended["ended"] = why(error)
            if journal.rows and isinstance(error, SerpentError):
                error.add_note(f"The {counted(journal.rows, 'row')} until then are kept in {path}.")
            raise
        finally:
            with uninterrupted():
                if journal.rows:
                    journal.seal(ended | dict(account()))
                else:
                    journal.discard()


def why(error: BaseException) -> str:
    """A log's text about the error that ended it."""
    by_hand = isinstance(error, KeyboardInterrupt)
    return "stopped by hand" if by_hand else str(error) or type(error).__name__


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise as Ctrl-C does, so that the arm stops and the log is sealed."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = {number: signal.signal(number, interrupt) for number in STOPPING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def loop_times(time: Array, period: float, missed: int) -> dict[str, float]:
    """How evenly rows at `time` [s], (T,), came: jitter is a step's difference from the period [s]."""
    jitter = np.abs(np.diff(time) - period) if len(time) > 1 else np.zeros(1)
    return {
        "period_s": period,
        "jitter_mean_s": float(jitter.mean()),
        "jitter_p99_s": float(np.quantile(jitter, 0.99)),
        "jitter_max_s": float(jitter.max()),
        "missed_deadlines": missed,
    }


def refuse_slow(times: Sequence[float], period: float) -> None:
    """Raise a `SerpentError` if the last rows, at times [s], came further apart than the period [s] by more
    than a log may: the arm would be controlled at another rate than is stated, and its log could not be read.
    """
    if len(times) % _ROWS or not times:
        return
    took = float(np.median(np.diff(times[-_LAST - 1 :])))
    if period / took < 1 - RATE_TOLERANCE:
        raise SerpentError(
            f"the control loop does {1 / took:.3g} steps a second of the {1 / period:.3g} that were asked "
            f"for, so it was stopped after {counted(len(times), 'row')}. Ask for a lower --rate-hz, "
            "or let nothing else run on this machine."
        )
