"""Define what a kind of machine must provide: how its logs are read, and first guesses."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import listed
from serpent_twin.tables.log import Log

if TYPE_CHECKING:
    from serpent_twin.machines.case import Case


NOTES = "reading_notes"
"""Key in a log's metadata: sentences on what was put right when the log was read"""
_SAME_CLOCK = 1.02
"""Ratio of the times between two rows up to which two logs have one clock"""
_CALIBRATION = ("direction", "zero", "homing_offset", "drive_mode")
"""Entries of the setup of a real arm's motors that say how their angles are counted"""


def read_logs(rig: "Rig", sources: Sequence[Path]) -> list[Any]:
    """The sessions of one machine in some folders or files, one after the other; with several, a session's
    name holds that of its folder, or of its file if that holds several. Raises a `SerpentError` that names
    what differs.
    """
    if len(sources) == 1:
        return list(rig.prepared(rig.recorded(sources[0])))
    logs: list[Any] = []
    for source in sources:
        found: Sequence[Any] = rig.recorded(source)
        alone = source.is_file() and len(found) == 1
        within = source.resolve().parent.name if alone else source.stem
        logs += [replace(log, label=f"{within}/{log.name}") for log in found]
    recorded = {log.name: _recorded(log) for log in logs}
    for key in dict.fromkeys(key for each in recorded.values() for key in each):
        first: dict[str, str] = {}
        for name, each in recorded.items():
            first.setdefault(each.get(key, "none"), name)
        if len(first) > 1:
            found = ", ".join(f"{value} in {name}" for value, name in first.items())
            raise SerpentError(
                f"the logs differ in {key}: {found}. Give logs of one machine, recorded alike."
            )
    period = {log.name: log.period for log in logs}
    slow, fast = max(period, key=period.__getitem__), min(period, key=period.__getitem__)
    if period[slow] > _SAME_CLOCK * period[fast]:
        raise SerpentError(
            f"the logs' clocks differ: {period[slow]:.4g} s a row in {slow}, {period[fast]:.4g} s in {fast}. "
            "Give logs of one machine, recorded alike."
        )
    if len({log.name for log in logs}) < len(logs):
        raise SerpentError(
            f"two sessions of {listed(sources)} have the same name, so they cannot be told apart. Rename a "
            "folder or a file."
        )
    return list(rig.prepared(logs))


def notes_on(logs: Sequence[Log]) -> list[str]:
    """Sentences on what was put right when logs were read, each once."""
    return list(dict.fromkeys(each for log in logs for each in log.metadata.get(NOTES, ())))


def is_named(log: Log, pattern: str) -> bool:
    """Whether a session, or its file, has a name of a pattern."""
    return fnmatchcase(log.name, pattern) or bool(log.path and log.path.match(pattern))


def _recorded(log: Log) -> dict[str, str]:
    """What logs must agree in: the machine, its rate, and how its motors' angles are counted."""
    told = {name: str(log.metadata.get(name)) for name in ("arm", "rate_hz")}
    setup: Mapping[str, Any] = log.metadata.get("setup") or {}
    for name in _CALIBRATION:
        for motor, value in enumerate(setup.get(name) or (), 1):
            told[f"{name} of motor {motor}"] = str(value)
    return told


class Rig(Protocol):
    """One kind of machine, and its logs."""

    @property
    def name(self) -> str:
        """Its name on the command line."""
        ...

    def recorded(self, source: Path) -> Sequence[Log]:
        """The sessions of a folder, or of one file; raises a `SerpentError` on logs that are not of this
        machine.
        """
        ...

    def prepared(self, logs: Sequence[Log]) -> Sequence[Log]:
        """All sessions that are used together, with what follows from them all."""
        ...

    def open(self, training: Sequence[Any]) -> "Case[Any]":
        """First guesses out of training logs."""
        ...

    def in_rows(self, case: "Case[Any]", training: Sequence[Any]) -> "Case[Any] | None":
        """The case of what rows say by themselves, without simulation; None where they say too little."""
        ...
