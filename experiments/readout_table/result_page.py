"""Write the errors of all readouts as a page."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

from experiments.result_page import PageContent
from serpent_twin.numerals import counted
from serpent_twin.runs.report import Section, Table

LABELS = {
    "analytical": "analytical, as published",
    "linear": "linear, as published",
    "no_load": "no_load, as published",
    "mlp": "mlp, as published",
    "lstm": "lstm, as published",
    "residual": "residual: ridge on the error of the stiff-cable pose",
    "residual_mlp": "residual_mlp: network on the error that this leaves",
    "decoder": "decoder: network → joints → kinematics",
    "ensemble": "ensemble of three of these",
}
READOUTS = tuple(LABELS)
_TEXT = """Mean marker error on the last session of each arm, on which no readout was trained, ± its
standard deviation over all markers and steps, in mm."""


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    arms = results["arms"]
    epochs = results["settings"]["epochs"]
    option = f" --epochs {epochs}" if epochs else ""
    if (wanted := _readouts_of(arms)) != list(READOUTS):
        option += f" --readout {' '.join(wanted)}"
    command = f"python -m experiments.readout_table --logs LOGS{option} --out readout_table"
    data = "; ".join(f"{name}, {_sessions(of['rows'])}" for name, of in arms.items())
    return PageContent(
        "Readouts' pose errors", command, data, (Section("", _TEXT, (error_table(arms),)),)
    )


def error_table(arms: Mapping[str, Any]) -> Table:
    """One row a readout, one column an arm."""
    rows = tuple(
        (LABELS.get(name, name), *(_cell(of["readouts"].get(name)) for of in arms.values()))
        for name in _readouts_of(arms)
    )
    note = ""
    if any("†" in cell for row in rows for cell in row):
        note = "† Training was stopped before the readout's own rule ends it."
    return Table(("readout", *(f"{arm} [mm]" for arm in arms)), rows, note)


def _readouts_of(arms: Mapping[str, Any]) -> list[str]:
    """Names of all readouts that were trained, in the order of the table."""
    trained = dict.fromkeys(name for of in arms.values() for name in of["readouts"])
    return sorted(trained, key=lambda name: (name not in LABELS, [*LABELS, name].index(name)))


def _cell(one: Mapping[str, Any] | None) -> str:
    if one is None:
        return "–"
    cut = " †" if one["stopped_after_epochs"] else ""
    return f"{one['mean_mm']:.1f} ± {one['std_mm']:.1f}{cut}"


def _sessions(rows: Sequence[int]) -> str:
    """Numbers of sessions of each length: `3 sessions × 1,200 rows`."""
    groups = [(n, len(list(of))) for n, of in groupby(sorted(rows))]
    return ", ".join(f"{counted(count, 'session')} × {n:,} rows" for n, count in groups)
