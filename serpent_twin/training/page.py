"""Write the report on trained readouts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.numerals import counted, listed
from serpent_twin.readouts.score import step_means
from serpent_twin.readouts.windows import Windows
from serpent_twin.runs.report import Figure, Report, Section, Table, versions_text
from serpent_twin.training import figures
from serpent_twin.training.tables import (
    PEER,
    adapt_table,
    best_of,
    cut_short,
    detail_table,
    interval,
    marker_table,
    score_table,
)
from serpent_twin.training.uncertainty import METHOD


def page(scores: Mapping[str, Any], error_mm: Mapping[str, Array], test: Windows) -> Report:
    """The report: table, error by marker, over time, by window; distances [mm], (N, 9), by readout."""
    readouts = scores["readouts"]
    sections = [
        Section("How far off", METHOD, _how_far(readouts)),
        Section("Where along the arm", "", _along_the_arm(readouts)),
        Section("When", "", (_over_time(error_mm, test),)),
    ]
    if scores["windows"]:
        sections.append(Section("How much of the past", "", (_by_window(scores["windows"]),)))
    if "adapt" in scores:
        sections.append(_adapted(scores["adapt"]))
    tested = ", ".join(scores["test_sessions"])
    title = f"Pose readouts on {_folder(scores['logs'])}, tested on {tested}"
    return Report(title, _lead(scores), tuple(sections), _facts(scores))


def _lead(scores: Mapping[str, Any]) -> str:
    readouts = scores["readouts"]
    name = best_of(readouts)
    best = readouts[name]
    known, stopped = interval(best), cut_short(best)
    mean = f"{best['mean_mm']:.2f} mm" + (f" (95 % interval {known})" if known != "–" else "")
    what = (
        f"{name}, whose training was stopped after {counted(stopped, 'epoch')},"
        if stopped
        else name
    )
    tested = ", ".join(scores["test_sessions"])
    lead = (
        f"{what} is nearest to the measured markers: {mean} on average over {tested}, which no readout saw "
        "before."
    )
    return " ".join(
        filter(None, (lead, _alike(readouts), _against_peer(readouts), scores.get("note")))
    )


def _alike(readouts: Mapping[str, Mapping[str, Any]]) -> str:
    """Readouts that do not differ significantly from the best."""
    against = {n: r["against_best"] for n, r in readouts.items() if "against_best" in r}
    alike = [
        n for n, a in against.items() if a["difference_interval_95_mm"] and not a["beyond_chance"]
    ]
    if not alike:
        return ""
    return (
        f"{listed(alike)} {'does' if len(alike) == 1 else 'do'} not differ from it beyond chance."
    )


def _against_peer(readouts: Mapping[str, Mapping[str, Any]]) -> str:
    """Ratio of the best readout's error to a peer's; of a peer that was cut short, only that fact."""
    name = best_of(readouts)
    if PEER not in readouts or name == PEER:
        return ""
    if stopped := cut_short(readouts[PEER]):
        return f"The training of {PEER} was stopped after {counted(stopped, 'epoch')}: it is no measure."
    share = readouts[name]["mean_mm"] / readouts[PEER]["mean_mm"]
    return f"That is {share:.2f} times the error of {PEER}."


def _how_far(readouts: Mapping[str, Mapping[str, Any]]) -> tuple[Table, ...]:
    return score_table(readouts), detail_table(readouts), _what_is_what(readouts)


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
    stopped = {n: cut_short(r) for n, of in windows.items() for r in of.values()}
    for name, count in stopped.items():
        caption += (
            f" The training of {name} was stopped after {counted(count, 'epoch')}." if count else ""
        )
    return Figure("error_by_window", figures.by_window(results), caption)


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
    return Path(logs).resolve().name


def _facts(scores: Mapping[str, Any]) -> dict[str, str]:
    origin = scores["provenance"]
    facts = {f"{part} sessions": ", ".join(n) for part, n in origin["sessions"].items()}
    facts |= {key: str(origin[key]) for key in ("window", "drop", "seed", "epochs", "threads")}
    facts |= {"commit": origin["git_commit"], "versions": versions_text(origin)}
    facts |= {f"sha256 of {name}": h for name, h in origin["input_sha256"].items()}
    if "adapt" not in scores:
        return facts
    real = scores["adapt"]["provenance"]
    facts |= {f"the arm's {part} sessions": ", ".join(n) for part, n in real["sessions"].items()}
    return facts | {f"sha256 of the arm's {n}": h for n, h in real["input_sha256"].items()}
