"""Write the results of the fault matrix as a page of docs/results/."""

from collections.abc import Mapping
from typing import Any

from experiments.result_page import PageContent
from serpent_twin.runs.report import Section, Table

LABELS = {
    "none": "none",
    "crc": "CRC, 0.5 % of answers",
    "drop": "dropped, 0.5 %",
    "truncate": "truncated, 0.5 %",
    "garbage": "garbage, 0.5 %",
    "late": "late by 60 ms, 0.5 %",
    "very_late": "late by 150 ms, 0.5 %",
    "deaf": "requests lost, 1 %",
    "all_of_the_wire": "five of these at once, 0.2 % each",
    "missing_for_a_moment": "a motor gone for 0.3 s",
    "watchdog": "a watchdog trips",
    "reboot": "a motor restarts, its turns lost",
    "unplug": "unplugged for 0.5 s",
    "missing": "a motor gone for good",
    "overload": "overload",
    "voltage": "low voltage",
}
_TEXT = """Every fault was run through {cycles} cycles of the whole collect loop at {rate_hz:g} Hz in
real time, on the [emulator](../emulator.md). Each row of the log was compared, word for word, with the
true state of the motors:"""
_NOTES = """"Rest" means that no motor is driven any more. The time is counted from the kill. For the
faults that no program can recover from (a motor gone for good, overload, low voltage), it is counted
from the fault. These runs end with a sentence that names the motor and the cause, and with a sealed
log.

"Marked rows" follow an interval in which a command was not in force throughout; the log marks them."""
_CYCLE = """One cycle of read, command and check takes {in_process:.1f} ms in process and {wire:.1f} ms
over the wire. With the wire paced to 1 MBd it takes {paced:.1f} ms, which is {ratio:.2f} × the time of
its bytes."""


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    settings, cycle = results["settings"], results["cycle_ms"]
    times = _CYCLE.format(
        in_process=cycle["in_process"]["median"],
        wire=cycle["over_the_wire"]["median"],
        paced=cycle["over_the_wire_at_1_mbd"]["median"],
        ratio=cycle["over_the_wire_at_1_mbd"]["times_its_bytes"],
    )
    sections = (
        Section("", _TEXT.format(**settings), (_table(results["faults"]),)),
        Section("", times),
    )
    command = "python -m experiments.fault_matrix --out faults"
    return PageContent("Fault matrix", command, "a simulated device on a pseudo-terminal", sections)


def _table(faults: Mapping[str, Mapping[str, Any]]) -> Table:
    columns = {
        "fault": lambda row: LABELS[row["name"]],
        "occurrences": lambda row: str(sum(row["struck"].values())),
        "rows": "{rows}",
        "lost": "{rows_lost}",
        "wrong or stale": "{rows_wrong}",
        "recoveries": "{recoveries}",
        "marked rows": "{rows_interrupted}",
        "rest after kill -9, s": "{stop_s:.2f}",
    }
    return Table.of(({"name": name} | dict(row) for name, row in faults.items()), columns, _NOTES)
