"""Lay out the tables on trained readouts."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from serpent_twin.runs.report import Table

Scores = Mapping[str, Mapping[str, Any]]
"""Entries of scores.json by readout"""
PEER = "lstm"
"""The published readout that all are compared with, beside the best"""
AGAINST = ("best", PEER)
_STOPPED = (
    "* Training was stopped before the readout's own rule ends it: trained fully, the readout may "
    "have a smaller error."
)


def best_of(readouts: Scores) -> str:
    """Name of the readout with the least mean error."""
    return min(readouts, key=lambda name: readouts[name]["mean_mm"])


def cut_short(result: Mapping[str, Any]) -> int | None:
    """Epochs after which training was stopped before the readout's own rule ends it; None if it was not."""
    return result.get("stopped_after_epochs")


def score_table(readouts: Scores) -> Table:
    """The mean errors of scores.json with their intervals, the least marked."""
    columns: dict[str, Any] = {
        "readout": _name,
        "mean ± std [mm]": "{mean_mm:.2f} ± {std_mm:.2f}",
        "95 % interval [mm]": interval,
        "in 95 % regions [%]": _covered,
    }
    for key in AGAINST:
        if any(f"against_{key}" in result for result in readouts.values()):
            columns[f"above {key} [mm]"] = partial(_above, key=key)
    best = best_of(readouts)
    return Table.of(_named(readouts), columns, _note(readouts), lambda row: row["name"] == best)


def detail_table(readouts: Scores) -> Table:
    """The spread of errors, and the cost of training and of one estimate."""
    columns = {
        "readout": _name,
        "std of steps [mm]": "{std_of_step_means_mm:.2f}",
        "tip [mm]": "{tip_mm:.2f}",
        "training [s]": "{train_s:.1f}",
        "epochs": lambda row: str(row["epochs"] or ""),
        "one epoch [s]": lambda row: (
            f"{row['seconds_per_epoch']:.2f}" if row["seconds_per_epoch"] else ""
        ),
        "one estimate [ms]": "{latency_ms:.3f}",
    }
    note = (
        "Standard deviation over steps of each step's mean error; mean error of marker 9, the tip; the "
        "median time of an estimate of one row while the arm moves."
    )
    return Table.of(_named(readouts), columns, note)


def marker_table(readouts: Scores) -> Table:
    """Mean error of each marker."""
    columns: dict[str, Any] = {"mean error [mm] of marker": _name}
    for n in range(len(next(iter(readouts.values()))["per_marker_mm"])):
        columns[str(n + 1)] = f"{{per_marker_mm[{n}]:.2f}}"
    return Table.of(_named(readouts), columns)


def adapt_table(real: Mapping[str, Any]) -> Table:
    """Mean errors of readouts corrected by more and more windows of another arm."""
    windows = real["windows"]
    counts = list(dict.fromkeys(count for of in windows.values() for count in of))
    columns: dict[str, Any] = {
        "mean error [mm] after windows of the arm": lambda name: _starred(
            name, windows[name][counts[0]]
        )
    }
    columns |= {n: lambda name, n=n: _mean(windows[name][n]) for n in counts}
    note = "In brackets, the 95 % interval of the mean."
    if any(cut_short(of[counts[0]]) for of in windows.values()):
        note += f" {_STOPPED}"
    return Table.of(windows, columns, note)


def interval(result: Mapping[str, Any]) -> str:
    """The interval of a mean error; – where it is not known."""
    ends = result.get("mean_interval_95_mm")
    return f"{ends[0]:.2f} … {ends[1]:.2f}" if ends else "–"


def _mean(result: Mapping[str, Any]) -> str:
    known = interval(result)
    return f"{result['mean_mm']:.2f}" + (f" [{known}]" if known != "–" else "")


def _named(readouts: Scores) -> list[dict[str, Any]]:
    """Entries of scores.json with their readouts' names."""
    return [{"name": name} | dict(result) for name, result in readouts.items()]


def _name(row: Mapping[str, Any]) -> str:
    return _starred(row["name"], row)


def _starred(name: str, result: Mapping[str, Any]) -> str:
    return f"{name} *" if cut_short(result) else name


def _covered(row: Mapping[str, Any]) -> str:
    covered = row.get("coverage_95_percent")
    return "–" if covered is None else f"{covered:.1f}"


def _above(result: Mapping[str, Any], key: str) -> str:
    """Difference by which an error is larger than another's, and whether that is beyond chance."""
    found = result.get(f"against_{key}")
    if not found:
        return ""
    known = found["difference_interval_95_mm"] is not None
    verdict = ("beyond chance" if found["beyond_chance"] else "within chance") if known else "–"
    return f"{found['difference_mm']:+.2f} {verdict}".replace("-", "−")


def _note(readouts: Scores) -> str:
    of = readouts.values()
    said = [
        "Distances between estimated and measured markers on the test sessions: mean and standard deviation "
        "over all markers and steps, the 95 % interval of the mean, and the share of the markers in the 95 % "
        "regions that the readout states."
    ]
    if len(readouts) > 1:
        said.append(
            f"Above best: by how much the mean is larger than that of {best_of(readouts)}, and whether that "
            "is beyond chance."
        )
    if any(map(cut_short, of)):
        said.append(_STOPPED)
    if any(not r.get("mean_interval_95_mm") or r.get("coverage_95_percent") is None for r in of):
        said.append(
            "–: not known; of intervals and differences, for the test sessions are too short."
        )
    return " ".join(said)
