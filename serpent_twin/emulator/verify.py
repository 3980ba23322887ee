"""Check a host's log against what the motors did."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.hardware import xl430
from serpent_twin.sessions import Session
from serpent_twin.stored import contents, parse_json

STALE = 0.03
"""Between the time in a row and the time when the device was read [s]."""
MOST_BYTES = 1_000_000_000
"""Largest size of a transcript [bytes]"""
Event = dict[str, Any]


def read_transcript(path: Path) -> list[Event]:
    """The whole lines of a device's transcript; the last one of a killed device may be torn."""
    lines = contents(path, MOST_BYTES).split(b"\n")
    whole = [line for line in lines if line.endswith(b"}")]
    return [parse_json(line, dict[str, Any], str(path)) for line in whole]


@dataclass(frozen=True)
class RowCounts:
    """Numbers of rows of a session that differ from the motors' true state."""

    wrong: int
    """The device never was so, or never followed the row's command though nothing was noted"""
    stale: int
    """The device was so, but at another time than that of the row"""
    interrupted: int
    """The row's command was not in force to the next row, whose `recoveries` count that"""


def check_rows(session: Session, events: Iterable[Event]) -> RowCounts:
    """Compare a session, of motors with zero 0 and direction 1, word for word with a transcript."""
    reads = defaultdict(list)
    for event in events:
        if event["event"] == "read":
            reads[_words_of_event(event)].append(event)
    found = [reads[words] for words in _words_of_rows(session)]
    clock = next(
        (reads[-1]["host_s"] - t for reads, t in zip(found, session.time, strict=True) if reads), 0
    )
    near = [
        [event for event in events if abs(event["host_s"] - clock - time) < STALE]
        for events, time in zip(found, session.time, strict=True)
    ]
    command = xl430.words(session.motor_velocity_command, xl430.VELOCITY_UNIT).tolist()
    other = np.array(
        [
            bool(events) and events[-1]["velocity_trajectory"] != goal
            for events, goal in zip(near[1:], command, strict=False)
        ],
        bool,
    )
    noted = session.extra["recoveries"][1:] > 0
    return RowCounts(
        wrong=sum(not events for events in found) + int((other & ~noted).sum()),
        stale=sum(bool(f) and not n for f, n in zip(found, near, strict=True)),
        interrupted=int((other & noted).sum()),
    )


def _words_of_rows(session: Session) -> Iterator[tuple[int, ...]]:
    columns = (
        session.extra["motor1_tick_ms"].astype(int)[:, None],
        xl430.words(session.motor_position, xl430.POSITION_UNIT),
        xl430.words(session.motor_velocity, xl430.VELOCITY_UNIT),
        xl430.words(session.motor_load, xl430.LOAD_UNIT),
    )
    yield from map(tuple, np.concatenate(columns, axis=1).tolist())


def _words_of_event(event: Event) -> tuple[int, ...]:
    columns = (event["true_position"], event["present_velocity"], event["present_load"])
    return (event["tick"][0], *(word for column in columns for word in column))
