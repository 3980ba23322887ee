"""Lay out the tables on trained readouts."""

from collections.abc import Mapping
from typing import Any

from serpent_twin.reporting.report import Table

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
    against = [key for key in AGAINST if any(f"against_{key}" in r for r in readouts.values())]
    header = ("readout", "mean ± std [mm]", "95 % interval [mm]", "in 95 % regions [%]")
    rows = tuple(
        (_name(name, result), *_errors(result), *(_above(result, key) for key in against))
        for name, result in readouts.items()
    )
    best = frozenset({list(readouts).index(best_of(readouts))})
    return Table((*header, *(f"above {key} [mm]" for key in against)), rows, _note(readouts), best)


def detail_table(readouts: Scores) -> Table:
    """The spread of errors, and the cost of training and of one estimate."""
    header = (
        "readout",
        "std of steps [mm]",
        "tip [mm]",
        "training [s]",
        "epochs",
        "one epoch [s]",
        "one estimate [ms]",
    )
    rows = tuple((_name(name, result), *_details(result)) for name, result in readouts.items())
    note = (
        "Standard deviation over steps of each step's mean error; mean error of marker 9, the tip; the "
        "median time of an estimate of one row while the arm moves."
    )
    return Table(header, rows, note)


def marker_table(readouts: Scores) -> Table:
    """Mean error of each marker."""
    rows = tuple(
        (_name(name, result), *(f"{value:.2f}" for value in result["per_marker_mm"]))
        for name, result in readouts.items()
    )
    return Table(("mean error [mm] of marker", *map(str, range(1, len(rows[0])))), rows)


def adapt_table(real: Mapping[str, Any]) -> Table:
    """Mean errors of readouts corrected by more and more windows of another arm."""
    counts = list(dict.fromkeys(count for of in real["windows"].values() for count in of))
    rows = tuple(
        (_name(name, of[counts[0]]), *(_mean(of[count]) for count in counts))
        for name, of in real["windows"].items()
    )
    note = "In brackets, the 95 % interval of the mean."
    if any(name.endswith("*") for name, *_ in rows):
        note += f" {_STOPPED}"
    return Table(("mean error [mm] after windows of the arm", *counts), rows, note)


def interval(result: Mapping[str, Any]) -> str:
    """The interval of a mean error; – where it is not known."""
    ends = result.get("mean_interval_95_mm")
    return f"{ends[0]:.2f} … {ends[1]:.2f}" if ends else "–"


def _mean(result: Mapping[str, Any]) -> str:
    known = interval(result)
    return f"{result['mean_mm']:.2f}" + (f" [{known}]" if known != "–" else "")


def _name(name: str, result: Mapping[str, Any]) -> str:
    return f"{name} *" if cut_short(result) else name


def _errors(result: Mapping[str, Any]) -> tuple[str, ...]:
    covered = result.get("coverage_95_percent")
    mean = f"{result['mean_mm']:.2f} ± {result['std_mm']:.2f}"
    return mean, interval(result), "–" if covered is None else f"{covered:.1f}"


def _above(result: Mapping[str, Any], key: str) -> str:
    """By how much an error is larger than another's, and whether that is beyond chance."""
    found = result.get(f"against_{key}")
    if not found:
        return ""
    known = found["difference_interval_95_mm"] is not None
    verdict = ("beyond chance" if found["beyond_chance"] else "within chance") if known else "–"
    return f"{found['difference_mm']:+.2f} {verdict}".replace("-", "−")


def _details(result: Mapping[str, Any]) -> tuple[str, ...]:
    each, epochs = result["seconds_per_epoch"], result["epochs"]
    return (
        f"{result['std_of_step_means_mm']:.2f}",
        f"{result['tip_mm']:.2f}",
        f"{result['train_s']:.1f}",
        str(epochs) if epochs else "",
        f"{each:.2f}" if each else "",
        f"{result['latency_ms']:.3f}",
    )


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
