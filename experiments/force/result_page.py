"""Write how well forces are felt as a page."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.confusion.score import Share
from experiments.force.trial import STEP_N, WEIGHT_KG
from experiments.result_page import PageContent, failures
from serpent_twin.estimators.force_filter import SIZE, WALK
from serpent_twin.numerals import counted
from serpent_twin.runs.plot_style import COLOURS, finish, sheet
from serpent_twin.runs.report import Figure, Section, Table

_WORTH = 0.95
"""Probability with which the ideal detector reports a push that is worth feeling"""
_STRONG = 0.3
"""[N]"""

Rows = Sequence[Mapping[str, Any]]


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    rows = results["rows"]
    return PageContent(
        "Feeling forces",
        "python -m experiments.force --study STUDY",
        f"{counted(len(rows), 'arm')} of `bench_arm`, which shares no physics with the twin",
        (
            Section("", _INTRODUCTION, (_by_arm(rows), _drawn(rows))),
            Section("Contacts", _contacts_told(rows), (_contacts(rows),)),
            Section("A weight", _WEIGHT, (_weights(rows),)),
            Section("Beside readouts", _READOUTS, (_learned(rows),)),
            *failures("Arms that failed", results),
        ),
    )


_INTRODUCTION = (
    "Arms move to random targets at 4 Hz while known forces of 0.1 … 1.5 N push their links: steps, ramps "
    "and swings, half of them at the last link. The observer of the twin that `trace` wrote, with the loads' "
    "error of its logs, says what pushes. *Least* is computed, not measured: the error of one who knows the "
    "arm, the link and since when it is pushed, from whom only the loads' noise keeps a force that wanders "
    f"as the filter has it: each component of {SIZE:g} N, changing by {WALK:g} N in a second. Motors that "
    "stand tell nothing there. The error may be less where most forces are smaller than that."
)
_WEIGHT = (
    f"The gripper holds {1e3 * WEIGHT_KG:.0f} g that the twin does not have: "
    f"{9.81 * WEIGHT_KG:.2f} N straight down, whatever the pose."
)
_READOUTS = (
    "Readouts learn forces from windows of four logs of the same arm, 16 minutes with 32 pushes; one more "
    "validates them, and the last one, unseen, is scored here. *None* says always zero. The observer learns "
    "from no push at all."
)


def _by_arm(rows: Rows) -> Table:
    columns = {
        "what is wrong": _wrong,
        "force": "{random[pushed_N]:.2f}",
        "error": "{random[rms_N]:.2f}",
        "stated": "{random[stated_N]:.2f}",
        "least": "{random[least_N]:.2f}",
        "error / least": lambda row: f"{row['random']['rms_N'] / row['random']['least_N']:.2f}",
        "error, free": "{random[rms_free_N]:.2f}",
        "estimate [ms]": "{update_ms[median]:.1f}",
        "its p99": "{update_ms[p99]:.1f}",
    }
    note = (
        "Rms over the rows in which something pushes, and of the others [N]. Times are on one core that had "
        "other work."
    )
    return Table.of(rows, columns, note)


def _wrong(row: Mapping[str, Any]) -> str:
    return row["name"].replace("_", " ")


def _pushes(rows: Rows, of: str) -> list[Mapping[str, Any]]:
    return [each for row in rows for each in row[of]]


def _contacts_told(rows: Rows) -> str:
    hours, false = sum(r["free_hours"] for r in rows), sum(r["false_contacts"] for r in rows)
    return (
        f"In {hours:.1f} hours without a touch, the observers reported {counted(false, 'false contact')}. "
        f"By the fault of each arm, there were: {_listed(rows)}. A push "
        "is found in its first second if contact is reported within it. How much that second can tell "
        "depends on pose, direction and link: where a force hardly turns a joint, or motors stand, nobody "
        "could feel it. *Possible* is how many would be reported within that second by the ideal detector. "
        "It knows the arm and the noise of its loads, but not when something pushes, where, or with which "
        "force, and reports contacts that are none once an hour at most. *Worth feeling* are those that it "
        f"would report in {100 * _WORTH:.0f} % of cases."
    )


def _listed(rows: Rows) -> str:
    several: dict[str, list[str]] = {}
    for row in rows:
        name = "no fault" if row["name"] == "none" else row["name"].replace("_", " ")
        several.setdefault(name, []).append(str(row["false_contacts"]))
    return ", ".join(f"{name} {' and '.join(counts)}" for name, counts in several.items())


def _contacts(rows: Rows) -> Table:
    steps = [each for each in _pushes(rows, "steps") if not each["felt_before"]]
    strong = [
        each
        for each in _pushes(rows, "pushes")
        if each["most_N"] >= _STRONG and not each["felt_before"]
    ]
    several = (
        (f"steps of {STEP_N:g} N", steps),
        ("the same at the last link", [each for each in steps if each["link"] == 9]),
        ("the same, worth feeling", [each for each in steps if each["possible_in_1s"] >= _WORTH]),
        (f"random pushes of {_STRONG:g} N or more", strong),
        ("the same, worth feeling", [each for each in strong if each["possible_in_1s"] >= _WORTH]),
    )
    columns = {
        "pushes": "{name}",
        "of them": "{number}",
        "possible": "{possible:.0f}",
        "found within 1 s": "{soon}",
        "found": "{found}",
        "link right": "{exact}",
        "or next to it": "{near}",
    }
    note = "In brackets, 95 % intervals. Links of those that were found."
    return Table.of((_counts(*each) for each in several), columns, note)


def _counts(name: str, pushes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How many pushes could be found and were, and on which link."""
    found = [each for each in pushes if each["found_after_s"] is not None]
    off = [abs(each["told_link"] - each["link"]) for each in found]
    return {
        "name": name,
        "number": len(pushes),
        "possible": sum(each["possible_in_1s"] for each in pushes),
        "soon": Share(sum(each["found_after_s"] <= 1.0 for each in found), len(pushes)),
        "found": Share(len(found), len(pushes)),
        "exact": Share(off.count(0), len(found)),
        "near": Share(off.count(0) + off.count(1), len(found)),
    }


def _weights(rows: Rows) -> Table:
    columns = {
        "what is wrong": _wrong,
        "felt": lambda each: f"{100 * each['felt_share']:.0f} %",
        "mean force [N], x down unless the base leans": lambda each: ", ".join(
            f"{value:.2f}" for value in each["mean_N"] or ()
        ),
        "where": lambda each: f"link {each['link']}" if each["mean_N"] else "",
        "called a weight": lambda each: (
            f"{1e3 * each['weight_kg']:.0f} g" if each["weight_kg"] else "no"
        ),
    }
    several = [{"name": row["name"]} | each for row in rows for each in row["weights"]]
    note = "The share of the rows in which contact is reported, and the mean over them."
    return Table.of(several, columns, note)


def _learned(rows: Rows) -> Table:
    def cell(name: str, part: str) -> str:
        errors = np.array([row["learned"][name][part] for row in rows])
        return f"{np.median(errors):.2f} ({errors.max():.2f})"

    columns = {
        "estimate": str,
        "error, pushed [N]": lambda name: cell(name, "pushed"),
        "error, free [N]": lambda name: cell(name, "free"),
    }
    note = "Rms, the median over the arms and, in brackets, the greatest."
    return Table.of(rows[0]["learned"], columns, note)


def _drawn(rows: Rows) -> Figure:
    drawing, (left, right) = sheet(7.0, 3.2, columns=2)
    pushes = _pushes(rows, "pushes")
    size, error = (np.array([each[name] for each in pushes]) for name in ("most_N", "rms_N"))
    last = np.array([each["link"] == 9 for each in pushes])
    for which, name, colour in ((last, "link 9", COLOURS[1]), (~last, "other links", COLOURS[2])):
        left.plot(size[which], error[which], "o", ms=3.5, color=colour, label=name)
    left.plot([0.1, 1.5], [0.1, 1.5], "--", lw=1.0, color=COLOURS[0], label="as large as the push")
    left.set_xscale("log")
    left.set_yscale("log")
    left.set_xlabel("greatest force [N]")
    left.set_ylabel("error of the estimate [N rms]")
    steps = [e for e in _pushes(rows, "steps") if not e["felt_before"]]
    worth = np.array([max(each["worth_after_1s"], 0.1) for each in steps])
    after = np.array([each["found_after_s"] or np.nan for each in steps])
    could = np.array([each["possible_in_1s"] >= _WORTH for each in steps])
    for which, name, colour in (
        (could, "worth feeling", COLOURS[1]),
        (~could, "others", COLOURS[2]),
    ):
        right.plot(worth[which], after[which], "o", ms=3.5, color=colour, label=name)
    lost = np.isnan(after)
    right.plot(worth[lost], np.full(lost.sum(), 11.0), "x", ms=4, color=COLOURS[3])
    right.legend(loc="upper right", bbox_to_anchor=(1.0, 0.93))
    right.set_xscale("log")
    right.set_xlabel("worth of the first second [standard errors²]")
    right.set_ylabel("found after [s]")
    left.legend(loc="lower right")
    finish(drawing, left, legend=False)
    finish(drawing, right, legend=False)
    caption = (
        f"Left: every random push. Right: steps of {STEP_N:g} N that last 10 s; crosses were not found. "
        "The ideal detector would report those worth feeling within a second."
    )
    return Figure("force", drawing, caption)
