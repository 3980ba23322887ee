"""Write the fit to the published table as a page."""

from collections.abc import Mapping
from typing import Any

from experiments.result_page import PageContent
from serpent_twin.numerals import counted
from serpent_twin.runs.report import Section, Table

LABELS = {
    "mlp": "PRC-MLP",
    "lstm": "LSTM",
    "no_load": "No-load",
    "linear": "PRC-LIN",
    "analytical": "Analytical",
}
"""The published names, in the published order"""
UNITS = {
    "strand_stiffness": (1e-3, "kN/m"),
    "strand_slack": (1e3, "mm"),
    "joint_friction": (1e3, "mN m"),
    "joint_damping": (1e3, "mN m s/rad"),
    "gear_friction": (1e3, "mN m"),
    "controller_gain": (1.0, "1/s"),
    "marker_noise": (1e3, "mm"),
    "load_noise": (1e2, "%"),
}
_TEXT = """The only published measurement of the real arm is a table of mean marker errors, one for each
of five pose readouts. The free parameters of the twin are fitted to it; the nominal twin is the stored
run whose full simulation comes nearest to all of them. The published ± may be over all markers and
steps, or over steps of each step's mean: both are shown. [The fit to
the published table](../reference/published-table.md) says what to make of it."""
_SENSITIVITY = """How much each mean error of a short run changes when one parameter goes from its lower
to its upper bound, with the others midway. The values are from an emulator with quadratic terms, whose
leave-one-out error over {runs} is {error:.1f} %. A short run has {sessions} sessions × {steps:,} steps
and {epochs} epochs."""


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    size, run = results["full_size"], results.get("run") or {}
    data = f"{size['sessions']} sessions × {size['steps']:,} steps of the twin, scored on the last"
    if run.get("date"):
        data += f"; run of {run['date']}, commit {run['git_commit']}"
    sections = [
        Section("", _TEXT, (error_table(results),)),
        Section("Parameters", "", (_parameter_table(results),)),
    ]
    if found := results["sensitivity"]:
        runs, error = counted(found["short_runs"], "short run"), 100 * found["leave_one_out_error"]
        text = _SENSITIVITY.format(runs=runs, error=error, **results["short_size"])
        title = "What the table determines"
        sections.append(Section(title, text, (sensitivity_table(results),)))
    command = "python -m experiments.paper_table"
    return PageContent("The paper's table", command, data, tuple(sections))


def error_table(results: Mapping[str, Any]) -> Table:
    """Paper beside twin: means, and both readings of the published ±."""
    rows = (
        {"label": label, "mm": results["paper_mm"][name], "std": results["paper_std_mm"][name]}
        | results["errors"][name]
        for name, label in LABELS.items()
    )
    columns = {
        "readout": "{label}",
        "paper [mm]": "{mm} ± {std}",
        "twin [mm]": "{mean_mm:.1f} ± {std_mm:.1f}",
        "twin, ± of step means [mm]": "{std_of_step_means_mm:.1f}",
        "off by": lambda row: _change(row["mean_mm"] / row["mm"] - 1),
    }
    return Table.of(rows, columns)


def _parameter_table(results: Mapping[str, Any]) -> Table:
    columns = {
        "parameter": _label,
        "nominal twin": lambda name: _told(results["parameters"][name], name),
        "range of the short runs": lambda name: _range(results, name),
    }
    return Table.of(UNITS, columns)


def sensitivity_table(results: Mapping[str, Any]) -> Table:
    """Change of each error from a parameter's lower to its upper bound."""
    changes = results["sensitivity"]["change"]
    rows = tuple(
        (f"{_label(name)} {_range(results, name)}", *map(_change, of.values()))
        for name, of in changes.items()
    )
    return Table(("from low to high", *next(iter(changes.values()))), rows)


def _range(results: Mapping[str, Any], name: str) -> str:
    low, high = results["ranges"][name]
    scale, unit = UNITS[name]
    return f"{scale * low:.3g} … {scale * high:.3g} {unit}"


def _told(value: float, name: str) -> str:
    scale, unit = UNITS[name]
    return f"{scale * value:.3g} {unit}"


def _label(name: str) -> str:
    return name.replace("_", " ")


def _change(share: float) -> str:
    percent = round(100 * share)
    return f"{percent:+d} %".replace("-", "−") if percent else "0 %"
