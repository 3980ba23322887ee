"""Count how often an arm's fault is named, and from which strength on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import binomtest

from experiments.confusion import expected
from experiments.confusion.plan import CLEAN, KNOWN, OUTSIDE, PAIR
from serpent_twin.arrays import Array
from serpent_twin.identification.estimates import ParameterEstimate, length_of

Row = Mapping[str, Any]
"""One line of results.jsonl"""
NOTHING, UNEXPLAINED, SEVERAL = "nothing", "unexplained", "several"
AIM = 0.95
_FEWEST = 5  # trials of an effect from which a limit is fitted
_WEIGHT = 0.02  # of the slope's square: keeps it finite where right and wrong do not overlap


def called(row: Row) -> str:
    """The trace's answer on an arm: one name, several, unexplained or nothing."""
    named = row["named"]
    if named:
        return named[0]["name"] if len(named) == 1 else SEVERAL
    return UNEXPLAINED if row["unexplained"] else NOTHING


def discovered(row: Row) -> bool:
    """Whether the fault outside the catalogue was composed: the right law at the right place, alone."""
    named, answers = row["named"], row["truth"]["effects"][0].get("answers", [])
    return len(named) == 1 and expected.matches(named[0], answers)


def right(row: Row) -> bool:
    """Whether exactly the injected effects are named; an effect outside the catalogue must be discovered, the
    right law at its place, or be called unexplained.
    """
    if row["kind"] == OUTSIDE:
        return called(row) == UNEXPLAINED or discovered(row)
    wanted = {effect["name"] for effect in row["truth"]["effects"]}
    return {effect["name"] for effect in row["named"]} == wanted


def matrix(rows: Sequence[Row]) -> tuple[list[str], list[str], Array]:
    """Counts of what was called (columns) by what was there (rows), of arms with one fault or none."""
    single = [row for row in rows if row["kind"] != PAIR]
    there = list(dict.fromkeys(sorted((row["name"] for row in single), key=_by_kind(single))))
    said = {called(row) for row in single}
    names = [n for n in there if n in said] + sorted(said - {*there, NOTHING, UNEXPLAINED, SEVERAL})
    columns = names + [n for n in (SEVERAL, UNEXPLAINED, NOTHING) if n in said]
    counts = np.zeros((len(there), len(columns)))
    for row in single:
        counts[there.index(row["name"]), columns.index(called(row))] += 1
    return there, columns, counts


def _by_kind(rows: Sequence[Row]) -> Any:
    order = {row["name"]: ((KNOWN, OUTSIDE, CLEAN).index(row["kind"]), row["name"]) for row in rows}
    return lambda name: order[name]


@dataclass(frozen=True)
class Share:
    """A count out of a total, with a 95 % interval (Wilson)."""

    count: int
    of: int

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the share [1]."""
        if not self.of:
            return 0.0, 1.0
        found = binomtest(self.count, self.of).proportion_ci(method="wilson")
        return float(found.low), float(found.high)

    def numbers(self) -> dict[str, Any]:
        """Numbers of the share and its interval for results.json."""
        low, high = self.interval
        share = self.count / self.of if self.of else None
        return {"count": self.count, "of": self.of, "share": share, "low": low, "high": high}

    def __str__(self) -> str:
        if not self.of:
            return "no trials"
        low, high = (100 * x for x in self.interval)
        return f"{self.count} of {self.of} ({low:.0f} … {high:.0f} %)"


def share(rows: Sequence[Row], good: Any) -> Share:
    """How many rows are good."""
    return Share(sum(bool(good(row)) for row in rows), len(rows))


@dataclass(frozen=True)
class Limit:
    """Strength from which on an effect is named right in 95 of 100 arms."""

    name: str
    unit: str
    right: Share
    strength: Array
    """Strength of every trial, rising"""
    correct: Array
    """Whether it was named right"""
    limit: float
    """Detection limit in its unit; NaN where the trials do not determine it"""
    said: str
    """The limit in words"""

    def numbers(self) -> dict[str, Any]:
        """Numbers of the limit and its trials for results.json."""
        trials = [[float(s), bool(c)] for s, c in zip(self.strength, self.correct, strict=True)]
        limit = self.limit if np.isfinite(self.limit) else None
        return {"unit": self.unit, "limit": limit, "said": self.said, "trials": trials,
                "right": self.right.numbers()}  # fmt: skip


def limits(rows: Sequence[Row]) -> list[Limit]:
    """The detection limit of every effect of the catalogue that was tried alone."""
    known = [row for row in rows if row["kind"] == KNOWN]
    names = sorted({_scale(row) for row in known})
    return [_limit(name, [row for row in known if _scale(row) == name]) for name in names]


def _scale(row: Row) -> str:
    """The effect, with its variant where strengths of another are not to be compared with it."""
    variant = row["truth"]["effects"][0]["variant"]
    return f"{row['name']} ({variant})" if variant else row["name"]


def quantity(value: float, unit: str) -> str:
    """A number with its unit."""
    return f"{value:.3g} {unit}".removesuffix(" 1")


def _limit(name: str, rows: Sequence[Row]) -> Limit:
    unit = rows[0]["truth"]["effects"][0]["unit"]
    strength = np.array([row["truth"]["effects"][0]["strength"] for row in rows])
    order = np.argsort(strength)
    correct = np.array([right(row) for row in rows])[order]
    value, said = detection_limit(strength[order], correct, unit)
    return Limit(name, unit, share(rows, right), strength[order], correct, value, said)


def detection_limit(
    strength: Array, correct: Array, unit: str, aim: float = AIM
) -> tuple[float, str]:
    """Where a logistic curve over the logarithm of the strength reaches a rate, and this as text. Only a
    limit within the strengths tried is a number; with NaN, the text states what the trials show.
    """
    if len(strength) < _FEWEST:
        return np.nan, f"too few trials ({len(strength)})"
    low, high = quantity(strength.min(), unit), quantity(strength.max(), unit)
    if correct.all():
        return np.nan, f"below {low}, the weakest tried"
    if not correct.any():
        return np.nan, f"above {high}, the strongest tried"
    middle, slope = _logistic(np.log(strength), correct)
    at = np.exp(middle + np.log(aim / (1 - aim)) / slope) if slope > 0 else np.inf
    if not at <= strength.max():
        return np.nan, f"above {high}, the strongest tried"
    if at < strength.min():
        return np.nan, f"below {low}, the weakest tried"
    return float(at), quantity(at, unit)


def _logistic(x: Array, correct: Array) -> tuple[float, float]:
    """Middle and slope of P = 1 / (1 + exp(−slope (x − middle))), the slope held finite."""
    scale = max(float(x.std()), 1e-9)
    z, sign = (x - x.mean()) / scale, np.where(correct, 1.0, -1.0)

    def loss(p: Array) -> float:
        return float(np.logaddexp(0.0, -sign * (p[0] + p[1] * z)).sum() + _WEIGHT * p[1] ** 2)

    a, b = minimize(loss, [0.0, 1.0], method="BFGS").x
    return float(x.mean() - scale * a / b), float(b / scale)


def coverage(rows: Sequence[Row]) -> dict[str, Share]:
    """How often the true strength lies within the 95 % interval, of every effect that is named rightly,
    alone or in a pair, and of every law that is discovered rightly; `all` over all effects.
    """
    inside: dict[str, list[bool]] = {}
    for row in rows:
        named = {effect["name"]: effect["parameters"] for effect in row["named"]}
        for effect in row["truth"]["effects"]:
            for parameter in effect["strong"]:
                if found := named.get(effect["name"], {}).get(parameter):
                    true = effect["parameters"][parameter]
                    inside.setdefault(effect["name"], []).append(
                        found["low"] <= true <= found["high"]
                    )
        if sized := _sized(row):
            size, true = sized
            inside.setdefault(row["name"], []).append(size.low <= true <= size.high)
    shares = {name: Share(sum(hits), len(hits)) for name, hits in sorted(inside.items())}
    everything = [hit for hits in inside.values() for hit in hits]
    return shares | {"all": Share(sum(everything), len(everything))}


def within(rows: Sequence[Row], tolerance: float = 0.10) -> Share:
    """How often a rightly named strength, alone or in a pair, is within 10 % of the truth."""
    near = [each <= tolerance for row in rows for each in _offs(row)]
    return Share(sum(near), len(near))


def off(row: Row) -> float:
    """How far the first rightly named strength is from the truth, of the truth [1]; NaN where none is."""
    return next(iter(_offs(row)), float("nan"))


def _sized(row: Row) -> tuple[ParameterEstimate, float] | None:
    """The size of a law that is discovered rightly, of a vector its length, and its true size."""
    if row["kind"] != OUTSIDE or not discovered(row):
        return None
    (entry,), answers = row["named"], row["truth"]["effects"][0]["answers"]
    if not (true := expected.size_of(entry, answers)):
        return None
    sizes = [v for name, v in entry["parameters"].items() if name.startswith("size")]
    return length_of([ParameterEstimate(**each) for each in sizes]), float(true)


def _offs(row: Row) -> list[float]:
    """How far each rightly named strength, or size of a discovered law, is from the truth, of the truth."""
    if sized := _sized(row):
        size, true = sized
        return [abs(size.value - true) / true]
    named, out = {effect["name"]: effect["parameters"] for effect in row["named"]}, []
    for effect in row["truth"]["effects"]:
        if (found := named.get(effect["name"])) and effect["strong"]:
            true = np.array([effect["parameters"][n] for n in effect["strong"]])
            value = np.array(
                [found[n]["value"] if n in found else np.inf for n in effect["strong"]]
            )
            out.append(float(np.linalg.norm(value - true) / np.linalg.norm(true)))
    return out


def scores(rows: Sequence[Row]) -> dict[str, Any]:
    """All figures, as results.json holds them."""
    by = {kind: [r for r in rows if r["kind"] == kind] for kind in (CLEAN, KNOWN, PAIR, OUTSIDE)}
    found = {each.name: each for each in limits(rows)}
    above = [
        row
        for row in by[KNOWN]
        if row["truth"]["effects"][0]["strength"] >= found[_scale(row)].limit
        or found[_scale(row)].said.startswith("below")
    ]
    there, columns, counts = matrix(rows)
    return {
        "trials": len(rows),
        "false_alarms": share(by[CLEAN], lambda r: r["named"]).numbers(),
        "clean_called_unexplained": share(by[CLEAN], lambda r: r["unexplained"]).numbers(),
        "named_right": share(by[KNOWN], right).numbers(),
        "named_right_above_limit": share(above, right).numbers(),
        "pairs_right": share(by[PAIR], right).numbers(),
        "outside_called_unexplained": share(
            by[OUTSIDE], lambda r: called(r) == UNEXPLAINED
        ).numbers(),
        "outside_discovered": share(by[OUTSIDE], discovered).numbers(),
        "interval_holds": {n: s.numbers() for n, s in coverage(rows).items()},
        "strength_within_10_percent": within(rows).numbers(),
        "detection_limit": {n: each.numbers() for n, each in found.items()},
        "confusion": {"there": there, "called": columns, "counts": counts.tolist()},
        "seconds_a_trial": float(np.mean([r["seconds"] for r in rows])) if rows else None,
    }
