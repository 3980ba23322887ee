"""What does a reader want to know of the trained readouts?"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from serpent_twin.arm import Array
from serpent_twin.readout import figures
from serpent_twin.readout.score import step_means
from serpent_twin.readout.windows import Windows
from serpent_twin.report import Figure, Report, Section, Table


def score_table(readouts: Mapping[str, Mapping[str, Any]]) -> Table:
    """The figures of scores.json as a table, the least error marked."""
    header = ("readout", "mean ± std", "std of steps", "tip", "train s", "s/epoch", "latency ms")
    means = [r["mean_mm"] for r in readouts.values()]
    rows = tuple((name, *_cells(result)) for name, result in readouts.items())
    note = (
        "Distances between estimated and measured markers on the test sessions, in mm: mean and "
        "standard deviation over all markers and steps; standard deviation over steps of each "
        "step's mean; mean of marker 9, the tip. Latency is the median time of a one-row estimate."
    )
    return Table(header, rows, note, frozenset({int(np.argmin(means))}))


def _cells(result: Mapping[str, Any]) -> tuple[str, ...]:
    each = result["seconds_per_epoch"]
    return (
        f"{result['mean_mm']:.2f} ± {result['std_mm']:.2f}",
        f"{result['std_of_step_means_mm']:.2f}",
        f"{result['tip_mm']:.2f}",
        f"{result['train_s']:.1f}",
        f"{each:.2f}" if each else "",
        f"{result['latency_ms']:.3f}",
    )


def marker_table(readouts: Mapping[str, Mapping[str, Any]]) -> Table:
    """Mean error of each marker."""
    rows = tuple(
        (name, *(f"{value:.2f}" for value in result["per_marker_mm"]))
        for name, result in readouts.items()
    )
    header = ("mm, by marker", *map(str, range(1, len(rows[0]))))
    return Table(header, rows)


def page(scores: Mapping[str, Any], error_mm: Mapping[str, Array], test: Windows) -> Report:
    """The report: table, error by marker, over time, by window; distances [mm], (N, 9), by readout."""
    readouts = scores["readouts"]
    sections = [
        Section("How far off", "", (score_table(readouts), _what_is_what(readouts))),
        Section("Where along the arm", "", _along_the_arm(readouts)),
        Section("When", "", (_over_time(error_mm, test),)),
    ]
    if scores["windows"]:
        sections.append(Section("How much of the past", "", (_by_window(scores["windows"]),)))
    if "adapt" in scores:
        sections.append(_adapted(scores["adapt"]))
    title = f"Pose readouts on {_folder(scores['logs'])}"
    return Report(title, _lead(scores), tuple(sections), _facts(scores))


def _lead(scores: Mapping[str, Any]) -> str:
    readouts = scores["readouts"]
    best = min(readouts, key=lambda name: readouts[name]["mean_mm"])
    lead = (
        f"{best} is nearest to the measured markers: {readouts[best]['mean_mm']:.2f} mm on average "
        f"over {', '.join(scores['test_sessions'])}, which no readout saw before."
    )
    if "lstm" in readouts and best != "lstm":
        share = readouts[best]["mean_mm"] / readouts["lstm"]["mean_mm"]
        lead += f" That is {share:.2f} times the error of the LSTM."
    return f"{lead} {scores.get('note', '')}".strip()


def _what_is_what(readouts: Mapping[str, Mapping[str, Any]]) -> Table:
    return Table(("readout", "what it is"), tuple((n, r["about"]) for n, r in readouts.items()))


def _along_the_arm(readouts: Mapping[str, Mapping[str, Any]]) -> tuple[Table, Figure]:
    per_marker = {name: np.array(result["per_marker_mm"]) for name, result in readouts.items()}
    caption = "Mean error of each marker on the test sessions; errors add up towards the tip."
    return (
        marker_table(readouts),
        Figure("error_by_marker", figures.by_marker(per_marker), caption),
    )


def _over_time(error_mm: Mapping[str, Array], test: Windows) -> Figure:
    first = test.sessions[0]
    of_steps = {name: step_means(error[: len(first.x)]) for name, error in error_mm.items()}
    drawing = figures.over_time(first.time, of_steps)
    return Figure("error_over_time", drawing, f"Error averaged over markers during {first.name}.")


def _by_window(windows: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Figure:
    results = {name: {int(h): r for h, r in of.items()} for name, of in windows.items()}
    caption = (
        "By the number of rows in a window, H: the validation loss, in each readout's own scale, "
        "and the test error. Rings mark the least. The same steps are estimated for every H."
    )
    return Figure("error_by_window", figures.by_window(results), caption)


def adapt_table(real: Mapping[str, Any]) -> Table:
    """Mean errors of readouts corrected by more and more windows of another arm."""
    counts = list(dict.fromkeys(count for of in real["windows"].values() for count in of))
    header = ("mm, windows of the arm", *counts)
    rows = tuple(
        (name, *(f"{of[count]['mean_mm']:.2f}" for count in counts))
        for name, of in real["windows"].items()
    )
    return Table(header, rows)


def _adapted(real: Mapping[str, Any]) -> Section:
    text = (
        f"The same readouts on {', '.join(real['test_sessions'])} of {_folder(real['logs'])}, another arm: "
        "as they were trained (0), and corrected by its first windows."
    )
    caption = (
        "Mean error on the arm by how many of its windows a correction learned from; dotted: none."
    )
    curves = {name: _curve(of) for name, of in real["windows"].items()}
    drawing = figures.by_real_windows(curves)
    return Section(
        "On the arm itself",
        text,
        (adapt_table(real), Figure("error_by_real_windows", drawing, caption)),
    )


def _curve(of_counts: Mapping[str, Mapping[str, Any]]) -> dict[int, float]:
    points = sorted((each["real_windows"], each["mean_mm"]) for each in of_counts.values())
    return dict(points)


def _folder(logs: str) -> str:
    return logs.rstrip("/").split("/")[-1]


def _facts(scores: Mapping[str, Any]) -> dict[str, str]:
    origin = scores["provenance"]
    facts = {f"{part} sessions": ", ".join(n) for part, n in origin["sessions"].items()}
    facts |= {key: str(origin[key]) for key in ("window", "drop", "seed", "epochs", "threads")}
    facts |= {"commit": origin["git_commit"]}
    facts |= {"versions": ", ".join(f"{k} {v}" for k, v in origin["versions"].items())}
    facts |= {f"sha256 of {name}": h for name, h in origin["input_sha256"].items()}
    if "adapt" not in scores:
        return facts
    real = scores["adapt"]["provenance"]
    facts |= {f"the arm's {part} sessions": ", ".join(n) for part, n in real["sessions"].items()}
    return facts | {f"sha256 of the arm's {n}": h for n, h in real["input_sha256"].items()}
