"""Test the expectations of the stiffness sweep against its numbers."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.stiffness_sweep.plan import GRID, RATES, RATIO, RIGID, WEIGHTLESS, natural_period
from experiments.stiffness_sweep.rows import Rows
from experiments.stiffness_sweep.trend import (
    HELD,
    NOT,
    OPEN,
    Answer,
    Interval,
    both,
    correlation,
    falls,
    over_seeds,
    rises,
    too_few,
    trend,
)
from serpent_twin.arrays import Array
from serpent_twin.numerals import counted
from serpent_twin.reservoir.sweep_rows import SweepRow, error_of, steady_readouts, values

SLACK, STIFFNESS = 0, 1
_NOTHING = 0.01  # share of all capacity that counts as none
_TRAINED = ("residual", "linear")


def answers(rows: Rows) -> list[Answer]:
    """One for each expectation, computed from the rows."""
    return [answer(rows) for answer in ANSWERS]


def judged(expectation: str, verdict: str, why: str, few: str, **numbers: object) -> Answer:
    """An answer; undecided where the data are too few."""
    if few:
        verdict, why = OPEN, f"{few}; {why}"
    text = why[0].upper() + why[1:] + "."
    stored = {n: v.numbers() if isinstance(v, Interval) else v for n, v in numbers.items()}
    return Answer(expectation, verdict, text, stored)


def shorter_memory(rows: Rows) -> Answer:
    """The mean delay falls along stiffness."""
    delay = values(rows[GRID], lambda row: row.mean_delay)
    found = over_seeds(delay, lambda v: trend(v, -1))
    ratio = float(trend(values(rows[RATIO], lambda row: row.mean_delay).mean(axis=-1), -1))
    there = [row for row in rows[GRID] if row.slack == rows[RATIO][0].slack]
    alike = float(trend(values(there, lambda row: row.mean_delay).mean(axis=-1), -1))
    forgetting = over_seeds(values(rows[GRID], lambda row: row.forgetting), lambda v: trend(v, -1))
    ends = np.nanmean(delay, axis=(0, 2))[[0, -1]]
    why = (
        f"rank correlation of the linear memory's mean delay with stiffness {found}, mean over slacks; the "
        f"mean delay is {ends[0]:.2f} command periods at the softest and {ends[1]:.2f} at the stiffest; with "
        f"the damping ratio held, at {1e3 * rows[RATIO][0].slack:g} mm of slack, the correlation is "
        f"{_signed(ratio)}, with constant damping {_signed(alike)} there; the rate at which the body itself, "
        f"without sensors' noise, forgets has correlation {forgetting}"
    )
    return judged(
        "Stiffer cables shorten the memory", falls(found), why, too_few(delay, STIFFNESS),
        correlation=found, correlation_damping_ratio_held=ratio, forgetting=forgetting,
    )  # fmt: skip


def optimum(rows: Rows) -> Answer:
    """The useful capacity that sensors show is greatest where the natural period is the command period."""
    return _optimal(rows, lambda row: row.useful_total, "as sensors show it")


def noiseless_optimum(rows: Rows) -> Answer:
    """The useful capacity of the body itself, without noise, is greatest where the natural period is the
    command period.
    """
    return _optimal(rows, lambda row: row.noiseless_total, "in the body itself")


def _optimal(rows: Rows, capacity: Callable[[SweepRow], float], where: str) -> Answer:
    useful = values(rows[GRID], capacity)
    stiffness, rate = sorted({row.stiffness for row in rows[GRID]}), rows[GRID][0].rate
    found = [_optimum(useful, stiffness, rate)]
    for other in sorted({row.rate for row in rows[RATES]} - {rate}):
        of = [row for row in rows[RATES] if row.rate == other]
        found.append(_optimum(values(of, capacity), stiffness, other))
    numbers = {f"place_{each.rate:g}_hz": each.place for each in found}
    crossings = {f"crossing_{each.rate:g}_hz": each.crossing for each in found}
    few = too_few(useful, STIFFNESS) or (
        "" if np.nanmax(useful) > 0 else "it is nowhere above chance"
    )
    return judged(
        f"Useful capacity, {where}, has an optimum where the natural period meets the command period",
        found[0].verdict, "; ".join(each.said for each in found), few, **numbers, **crossings,
    )  # fmt: skip


@dataclass(frozen=True)
class Optimum:
    """Where useful capacity is greatest at one rate."""

    rate: float
    place: Interval
    """Place of the optimum, in steps of the stiffness axis"""
    crossing: float
    """Where the natural period is the command period, in the same steps; beyond the ends, an end"""
    verdict: str
    said: str


def _optimum(useful: Array, stiffness: Sequence[float], rate: float) -> Optimum:
    """Useful capacities (L, K, S) along stiffness at one rate; slacks are averaged."""
    place = over_seeds(useful, lambda v: np.argmax(np.nan_to_num(v.mean(axis=-2)), axis=-1))
    period = np.array([natural_period(k) for k in stiffness]) * rate
    steps, last = np.arange(len(stiffness)), len(stiffness) - 1
    crossing = float(np.interp(0.0, np.log(period[::-1]), steps[::-1]))
    best = round(place.value)
    most = float(np.nanmax(np.nanmean(useful, axis=(0, 2))))
    if not period[-1] < 1 < period[0]:
        verdict, where = OPEN, "no stiffness of the sweep makes them meet"
    else:
        at = float(np.exp(np.interp(crossing, steps, np.log(stiffness))))
        where = f"they meet at {at / 1e3:.3g} kN/m"
        near = place.low >= crossing - 1 and place.high <= crossing + 1
        far = place.high < crossing - 1 or place.low > crossing + 1
        verdict = HELD if near and 0 < best < last else NOT if far else OPEN
    end = ", an end of the range," if best in (0, last) else ""
    said = (
        f"at {rate:g} Hz the most, {most:.2f}, is at {stiffness[best] / 1e3:.3g} kN/m{end} where the natural "
        f"period is {period[best]:.2f} command periods, and {where}"
    )
    return Optimum(rate, place, crossing, verdict, said)


def slack_and_degrees(rows: Rows) -> Answer:
    """Capacity of degree 1 falls, and that of higher degrees rises, along slack."""
    first = values(rows[GRID], lambda row: float(row.capacity[0]))
    higher = values(rows[GRID], lambda row: row.beyond_linear)
    lower, raised = (over_seeds(each, lambda v: trend(v, -2)) for each in (first, higher))
    few = too_few(first, SLACK)
    why = (
        f"rank correlation with slack, mean over stiffnesses, is {lower} for degree 1 and {raised} for "
        "degrees from 2"
    )
    return judged(
        "Slack raises degrees from 2 and lowers degree 1", both(falls(lower), rises(raised)), why,
        few, degree_1=lower, degrees_from_2=raised,
    )  # fmt: skip


def gravity_and_even(rows: Rows) -> Answer:
    """Even degrees hold more with gravity than without, by more than a hundredth of all capacity."""
    without = rows[WEIGHTLESS]
    alike = {(row.stiffness, row.seed) for row in without}
    slack = {row.slack for row in without}
    held = [r for r in rows[GRID] if (r.stiffness, r.seed) in alike and r.slack in slack]
    share = [values(of, lambda row: row.even / row.total) for of in (held, without)]
    gain = over_seeds(share[0] - share[1], lambda v: np.nanmean(v, axis=(-1, -2)))
    verdict = HELD if gain.low > _NOTHING else NOT if gain.high <= _NOTHING else OPEN
    why = (
        f"even degrees are {_percent(share[0])} of the capacity with gravity and {_percent(share[1])} "
        f"without: a share of {gain} more, where {_NOTHING:g} counts"
    )
    return judged("Gravity brings even degrees", verdict, why, too_few(share[0], None), gain=gain)


def soft_and_consistency(rows: Rows) -> Answer:
    """Consistency rises along stiffness."""
    consistency = values(rows[GRID], lambda row: row.consistency)
    found = over_seeds(consistency, lambda v: trend(v, -1))
    ends = np.nanmean(consistency, axis=(0, 2))[[0, -1]]
    why = (
        f"rank correlation of the consistency with stiffness {found}, mean over slacks; it is {ends[0]:.2f} "
        f"at the softest and {ends[1]:.2f} at the stiffest"
    )
    return judged(
        "Too soft an arm loses consistency", rises(found), why, too_few(consistency, STIFFNESS),
        correlation=found,
    )  # fmt: skip


def analytical_fastest(rows: Rows) -> Answer:
    """The analytical error grows by a greater factor than that of any other readout as strands soften."""
    others = [name for name in steady_readouts(rows[GRID]) if name != "analytical"]
    stack = {name: values(rows[GRID], error_of(name)) for name in ("analytical", *others)}
    decade = np.log10(sorted({row.stiffness for row in rows[GRID]}))
    growth = {name: _per_decade(v.mean(axis=-1), decade) for name, v in stack.items()}
    rival = max(others, key=lambda name: growth[name])
    pair = np.stack([stack["analytical"], stack[rival]])
    lead = over_seeds(
        pair, lambda v: _per_decade(v[..., 0, :, :], decade) - _per_decade(v[..., 1, :, :], decade)
    )
    verdict = HELD if lead.low > 0 else NOT if lead.high < 0 else OPEN
    told = ", ".join(f"{name} {10**g:.2f}" for name, g in growth.items())
    why = (
        f"factor by which the error grows per decade of softening, mean over slacks: {told}; log10 of "
        f"analytical over {rival} is {lead}"
    )
    return judged(
        "The analytical error grows fastest as the arm softens", verdict, why,
        too_few(stack["analytical"], STIFFNESS), lead=lead,
        **{f"factor_{name}": 10**g for name, g in growth.items()},
    )  # fmt: skip


def _per_decade(error: Array, decade: Array) -> Array:
    """log10 growth of errors (…, L, K) per decade of softening, mean over slacks, (…)."""
    centred = decade - decade.mean()
    slope = (np.log10(error) * centred).sum(axis=-1) / (centred**2).sum()
    return -np.nanmean(slope, axis=-1)


def pose_and_overlap(rows: Rows) -> Answer:
    """Pose error falls with what the channels hold of the markers, more than with all that they hold."""
    name = next(name for name in _TRAINED if name in steady_readouts(rows[GRID]))
    error = values(rows[GRID], error_of(name))
    overlap = values(rows[GRID], lambda row: row.overlap)
    total = values(rows[GRID], lambda row: row.total)
    stack = np.stack([error, overlap, total])
    with_overlap, with_total = (over_seeds(stack, _against(i)) for i in (1, 2))
    lead = over_seeds(stack, lambda v: _against(2)(v) - _against(1)(v))
    better = HELD if lead.low > 0 else NOT if lead.high < 0 else OPEN
    why = (
        f"over all arms the {name} readout's error has rank correlation {with_overlap} with the share of "
        f"the markers that the channels hold, and {with_total} with the total capacity"
    )
    return judged(
        "Pose error follows not total capacity but the capacities that the markers contain",
        both(falls(with_overlap), better), why, _few_arms(error), overlap=with_overlap,
        total=with_total, lead=lead,
    )  # fmt: skip


def _against(which: int) -> Callable[[Array], Array]:
    def found(stack: Array) -> Array:
        flat = stack.reshape(*stack.shape[:-2], -1)
        return correlation(flat[..., 0, :], flat[..., which, :])

    return found


def _few_arms(error: Array) -> str:
    arms = error.shape[0] * error.shape[1]
    return too_few(error, None) or (
        f"{counted(arms, 'arm is', 'arms are')} too few" if arms < 8 else ""
    )


def _percent(share: Array) -> str:
    return f"{100 * np.nanmean(share):.2f} %"


def _signed(value: float) -> str:
    return f"{value:.2f}".replace("-", "−")


def control(rows: Rows) -> str:
    """What rigid cables leave, beside the stiffest and softest strands, in a sentence."""
    least = min(row.slack for row in rows[GRID])
    tight = [row for row in rows[GRID] if row.slack == least]
    ends = [end([row.stiffness for row in tight]) for end in (min, max)]
    soft, stiff = ([row for row in tight if row.stiffness == k] for k in ends)
    arms = {
        "on rigid cables": rows[RIGID],
        f"on strands of {ends[0] / 1e3:.3g} kN/m": soft,
        f"of {ends[1] / 1e3:.3g} kN/m": stiff,
    }
    shown = ", ".join(f"{_mean(row.useful_total for row in of):.2f} {k}" for k, of in arms.items())
    all_of_it = ", ".join(f"{_mean(row.noiseless_total for row in of):.2f}" for of in arms.values())
    return (
        f"Beyond the taps, motor angles and loads as read hold {shown}; joint angles and loads without any "
        f"noise {all_of_it}, at {1e3 * least:g} mm of slack. On rigid cables nothing is remembered: what is "
        "there is the arm's shape, which multiplies present inputs."
    )


def _mean(numbers: Iterable[float]) -> float:
    return float(np.nanmean(list(numbers)))


ANSWERS = (
    shorter_memory,
    optimum,
    noiseless_optimum,
    slack_and_degrees,
    gravity_and_even,
    soft_and_consistency,
    analytical_fastest,
    pose_and_overlap,
)
