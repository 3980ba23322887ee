"""Count how often the trace is right, from lines of arms."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.confusion.arm_line import BETWEEN, FAILED, ArmLine
from experiments.confusion.arms import AS_BUILT, BY_FIT
from experiments.confusion.plan import CLEAN, KNOWN, OUTSIDE, PAIR
from experiments.confusion.score import NOTHING, UNEXPLAINED, Share, detection_limit
from serpent_twin.effects.discovered import DISCOVERED

NAMED = 0.90
"""Rate at which effects are named from the strength on that is sought"""
STRONG = 2.0
"""Times a stated detection limit from which on an effect should be named"""
NEAR, LEFT = 0.15, 1.3
"""How far the size of a discovered law may be off, and what it may leave, of what a complete twin would"""
LAST = 50
"""How many arms as built, the last ones, show how good the program is now"""
_NONE = "none"
_WORTH = 30.0
"""Worth from which on traces sought a fault's law when worths were computed [squared standard errors]"""


def names_of(line: ArmLine) -> list[str]:
    """The names that a trace gave."""
    silent = (NOTHING, UNEXPLAINED, FAILED)
    return [] if line.called in silent else line.called.split(BETWEEN)


def wrong(line: ArmLine) -> bool:
    """Whether a trace gave a name of the catalogue that is not there."""
    there = line.there.split(BETWEEN)
    return any(name not in there and name != DISCOVERED for name in names_of(line))


def rates(lines: Sequence[ArmLine]) -> dict[str, Any]:
    """All figures, as results.json holds them."""
    known = [each for each in lines if each.kind == KNOWN]
    newest = [each for each in lines if each.generation >= AS_BUILT]
    groups = {"as_built": newest, "last": newest[-LAST:]}
    return {
        "arms": len(lines),
        **{group: len(some) for group, some in groups.items()},
        "versions_of_lines": sorted({each.version for each in lines}),
        "rates": _rates_of(lines, groups),
        "effects": _effects(known, lines),
        "named_from": _named_from(known),
        "trials": [_trial(each) for each in known if np.isfinite(each.of_limit)],
        "outside": _outside([each for each in lines if each.kind == OUTSIDE]),
        "called": _called(lines),
        "names": _track(lines),
        "commits": _commits(lines),
        "median_seconds": _median(each.seconds for each in lines),
    }


def _rates_of(
    lines: Sequence[ArmLine], groups: Mapping[str, Sequence[ArmLine]]
) -> dict[str, dict[str, Any]]:
    """Each rate, with its aim, of all lines, and of some groups of them."""
    of_groups = {group: _rates(some) for group, some in groups.items()}
    out: dict[str, dict[str, Any]] = {}
    for name, (share, aim) in _rates(lines).items():
        out[name] = share.numbers() | {"said": str(share), "aim": aim}
        for group, each in of_groups.items():
            found = each[name][0]
            out[name] |= {group: found.numbers(), f"{group}_said": str(found)}
    return out


def _rates(lines: Sequence[ArmLine]) -> dict[str, tuple[Share, str]]:
    """Each rate, with what it should be."""
    kinds = (CLEAN, KNOWN, PAIR, OUTSIDE)
    clean, known, pairs, outside = ([x for x in lines if x.kind == kind] for kind in kinds)
    faulty = [each for each in lines if each.kind != CLEAN]
    strong = [each for each in known if each.of_limit >= STRONG]
    sized = [each for each in outside if np.isfinite(each.off)]
    found = [each for each in outside if each.discovered]
    held = Share(sum(each.held for each in lines), sum(each.intervals for each in lines))
    told = [each for each in lines if each.right]
    parts = Share(sum(each.parts_held for each in told), sum(each.parts for each in told))
    return {
        "false alarms": (_share(clean, names_of), "at most 1 %"),
        "clean arms called unexplained": (_share(clean, lambda x: x.unexplained), "none"),
        "a name that is not there": (_share(faulty, wrong), "at most 2 %"),
        "named, from twice the detection limit on that its trace stated": (
            _share(strong, lambda x: x.right),
            "95 %",
        ),
        "true strength in its 95 % interval": (held, "93 … 97 %"),
        "on arms with the right verdict, a part's true size in its 95 % interval": (
            parts,
            "93 … 97 %",
        ),
        "an effect of the catalogue called unexplained": (
            _share(known, lambda x: x.unexplained),
            "none",
        ),
        "of a pair that can be confused, both named and nothing else": (
            _share(pairs, lambda x: x.right),
            "",
        ),
        "a fault outside the catalogue discovered or called unexplained": (
            _share(outside, lambda x: x.right),
            "",
        ),
        "its law and place discovered": (_share(outside, lambda x: x.discovered), "80 %"),
        f"the same, of faults whose law was worth {_WORTH:g} σ² or more": (
            _share([x for x in outside if x.worth >= _WORTH], lambda x: x.discovered),
            "80 %",
        ),
        "a discovered law's size within 15 %": (_share(sized, lambda x: x.off <= NEAR), ""),
        "error after it at most 1.3 times that of a complete twin": (
            _share(found, lambda x: x.corrected_mm <= LEFT * x.complete_mm),
            "",
        ),
        "traces that failed": (_share(lines, lambda x: x.called == FAILED), "none"),
    }


def _share(lines: Sequence[ArmLine], good: Callable[[ArmLine], Any]) -> Share:
    return Share(sum(bool(good(each)) for each in lines), len(lines))


def _median(values: Iterable[float]) -> float | None:
    """Median of the finite values; None without any."""
    there = [value for value in values if np.isfinite(value)]
    return float(np.median(there)) if there else None


def _effects(lines: Sequence[ArmLine], every: Sequence[ArmLine]) -> list[dict[str, Any]]:
    """Detection limits that traces stated for each effect of the catalogue, whether it was there or not, by
    the number of sessions; how often it was named, and how far strengths are off.
    """
    units = {each.there: each.unit for each in lines if each.unit}
    every = [each for each in every if each.generation >= BY_FIT]
    numbers = sorted({each.sessions for each in every if each.limits})
    out = []
    for name in sorted({each.there for each in lines}):
        some = [each for each in lines if each.there == name]
        held = Share(sum(each.held for each in some), sum(each.intervals for each in some))
        stated = {
            n: [each.stated_limits.get(name, np.nan) for each in every if each.sessions == n]
            for n in numbers
        }
        out.append(
            {
                "effect": name,
                "unit": units.get(name, "1"),
                "stated": {str(n): _median(several) for n, several in stated.items()},
                "right": str(_share(some, lambda each: each.right)),
                "strong": str(_share([x for x in some if x.of_limit >= STRONG], lambda x: x.right)),
                "median_off": _median(each.off for each in some),
                "held": str(held),
            }
        )
    return out


def _named_from(lines: Sequence[ArmLine]) -> str:
    """Multiple of its stated detection limit from which on `NAMED` of all effects are named, in words."""
    known = sorted((x.of_limit, x.right) for x in lines if np.isfinite(x.of_limit))
    times, right = np.array(known).reshape(-1, 2).T
    return detection_limit(times, right.astype(bool), "1", NAMED)[1]


def _outside(lines: Sequence[ArmLine]) -> list[dict[str, Any]]:
    """Rate of discovery of each fault outside the catalogue, and what was then left."""
    out = []
    for name in sorted({each.there for each in lines}):
        some = [each for each in lines if each.there == name]
        found = [each for each in some if each.discovered]
        out.append(
            {
                "fault": name,
                "discovered": _share(some, lambda each: each.discovered).numbers(),
                "unexplained": sum(each.called == UNEXPLAINED for each in some),
                "median_off": _median(each.off for each in found),
                "before": _median(each.calibrated_mm / each.complete_mm for each in found),
                "after": _median(each.corrected_mm / each.complete_mm for each in found),
            }
        )
    return out


def _trial(line: ArmLine) -> list[Any]:
    """What a picture needs of an arm: effect, times its limit, whether it was named right, sessions."""
    return [line.there, line.of_limit, line.right, line.sessions]


def _called(lines: Sequence[ArmLine]) -> list[list[Any]]:
    """What was there, what was called, and how often, of arms with one fault or none."""
    single = Counter(
        (each.there, each.called if len(names_of(each)) < 2 else "several")
        for each in lines
        if BETWEEN not in each.there
    )
    return [[there, called, count] for (there, called), count in sorted(single.items())]


def _track(lines: Sequence[ArmLine]) -> dict[str, dict[str, int]]:
    """Counts of each name that was given: how often it was given, and how often it was right; a discovered
    law must be the right one at its place.
    """
    given, right = Counter[str](), Counter[str]()
    for each in lines:
        for name in names_of(each):
            given[name] += 1
            right[name] += (
                each.discovered if name == DISCOVERED else name in each.there.split(BETWEEN)
            )
    return {name: {"given": n, "right": right[name]} for name, n in sorted(given.items())}


def _commits(lines: Sequence[ArmLine]) -> list[dict[str, Any]]:
    """Arms of each commit, and how many were right."""
    out = []
    for commit in dict.fromkeys(each.commit for each in lines):
        some = [each for each in lines if each.commit == commit]
        clean = [each for each in some if each.there == _NONE]
        out.append(
            {
                "commit": commit,
                "arms": len(some),
                "right": str(_share(some, lambda each: each.right)),
                "false_alarms": str(_share(clean, names_of)),
                "seconds": _median(each.seconds for each in some),
            }
        )
    return out
