"""Check that inputs can measure capacities: uniform, independent in time and of each other.

Capacities are shares of orthonormal targets only if they are. The distribution under chance is
known: √T times the mean of a normalised product is nearly standard normal.
"""

from collections.abc import Sequence

import numpy as np
import scipy

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.reservoir.targets import TargetProducts, checked_delays, label, legendre

FALSE_ALARM = 1e-6
"""Probability that one check of good inputs fails"""


def chance(tests: int) -> float:
    """Upper bound of the greatest of so many standard normal numbers, but for a false alarm."""
    return float(-scipy.special.ndtri(FALSE_ALARM / (2 * tests)))


def as_rows(values: Array, what: str) -> Array:
    """Finite values as (T, C) float64; raises SerpentError naming the row and column of one that is not."""
    rows = np.asarray(values, float)
    rows = rows[:, None] if rows.ndim == 1 else rows
    if rows.ndim != 2 or not rows.size:
        raise SerpentError(f"The {what} have shape {rows.shape}: give rows × columns.")
    if not np.isfinite(rows).all():
        row, column = np.argwhere(~np.isfinite(rows))[0]
        raise SerpentError(
            f"The {what} hold {rows[row, column]} at row {row}, column {column}: "
            "leave such rows out at an end of the log, or record it again."
        )
    return rows


def as_series(values: Array, what: str) -> Array:
    """Finite values of one series, (L, C) or (L,), or of several, (S, L, C), as (S, L, C) float64."""
    many = np.asarray(values, float)
    if many.ndim != 3:
        return as_rows(many, what)[None]
    return as_rows(many.reshape(-1, many.shape[-1]), what).reshape(many.shape)


def aligned(
    states: Array, inputs: Array, washout: int, delays: Sequence[int], what: str = "states"
) -> tuple[Array, Array, int]:
    """States (T, N) from each series' first row to use on, all inputs (S, L, m), and that row's number.

    Left out are the washout [rows] and at least the greatest delay. Raises SerpentError when a number is
    not finite, the rows do not pair or none are left.
    """
    series, drive = as_series(states, what), as_series(inputs, "inputs")
    if series.shape[:2] != drive.shape[:2]:
        raise SerpentError(
            f"There are {_counted(series)} of {what} and {_counted(drive)} of inputs: "
            "give the state after each input, row for row."
        )
    start, rows = max(washout, *delays), series.shape[1]
    if rows - start < 2:
        raise SerpentError(
            f"Of {counted(rows, 'row')} the first {start} are left out for washout and delays: "
            "give more rows or lower them."
        )
    return series[:, start:].reshape(-1, series.shape[-1]), drive, start


def _counted(series: Array) -> str:
    S, rows, _ = series.shape
    return f"{counted(rows, 'row')}" if S == 1 else f"{S} series of {counted(rows, 'row')}"


def in_a_row(inputs: Array) -> Array:
    """Series of inputs (S, L, m) one after the other, (S · L, m): independent ones stay independent."""
    return inputs.reshape(-1, inputs.shape[-1])


def check_inputs(inputs: Array, degree: int, delays: Sequence[int]) -> None:
    """Raise SerpentError unless inputs (T, m) are uniform on [−1, 1] and independent up to these delays.

    Polynomials of each input up to the degree are compared with those of every input at every delay.
    """
    delay = max(checked_delays(degree, delays))
    inputs = in_a_row(inputs)
    _check_range(inputs)
    _check_uniform(inputs, degree)
    columns = np.stack([legendre(inputs.T, d + 1) for d in range(degree)], axis=1)
    _check_pairs(columns, delay)


def check_white(inputs: Array, delay: int) -> None:
    """Raise SerpentError unless inputs (T, m), of any distribution, are uncorrelated up to a delay [rows]."""
    inputs = in_a_row(inputs)
    spread = inputs.std(axis=0)
    if not spread.all():
        raise SerpentError(
            f"Input {int(np.argmin(spread))} is constant: nothing of it can be remembered; leave it out."
        )
    _check_pairs(((inputs - inputs.mean(axis=0)) / spread).T[:, None], delay)


def check_means(mean: Array, sought: TargetProducts, rows: int) -> None:
    """Raise SerpentError if a product's mean (P,) over so many rows is not zero but for chance."""
    worst, limit = int(np.argmax(np.abs(mean))), chance(len(mean)) / np.sqrt(rows)
    if abs(mean[worst]) > limit:
        raise SerpentError(
            f"The inputs are not independent: the product {label(sought.product(worst))} has mean "
            f"{mean[worst]:.3f}, by chance below {limit:.3f}; draw every input again in every row."
        )


def _check_range(inputs: Array) -> None:
    row, source = np.unravel_index(np.argmax(np.abs(inputs)), inputs.shape)
    if abs(inputs[row, source]) > 1 + 1e-9:
        raise SerpentError(
            f"Input {source} is {inputs[row, source]:.3g} at row {row}, outside [−1, 1]: "
            "scale it by the range from which it was drawn."
        )


def _check_uniform(inputs: Array, degree: int) -> None:
    # Products of two polynomials up to the degree hold polynomials up to twice the degree.
    mean = np.stack([legendre(inputs, d + 1).mean(axis=0) for d in range(2 * degree)])
    limit = chance(mean.size) / np.sqrt(len(inputs))
    d, source = np.unravel_index(np.argmax(np.abs(mean)), mean.shape)
    if abs(mean[d, source]) > limit:
        raise SerpentError(
            f"Input {source} is not uniform on [−1, 1]: its Legendre polynomial of degree {d + 1} has mean "
            f"{mean[d, source]:.3f}, by chance below {limit:.3f}; draw it uniformly, or put it through its "
            "own distribution function."
        )


def _check_pairs(columns: Array, delay: int) -> None:
    """Compare polynomials (m, D, T) of variance 1 with one another at delays up to one [rows]."""
    m, D, T = columns.shape
    if delay > T - 2:
        raise SerpentError(
            f"A delay of {counted(delay, 'row')} is too long for {T} rows of inputs."
        )
    flat = columns.reshape(m * D, T)
    score = np.stack([flat[:, k:] @ flat[:, : T - k].T / np.sqrt(T - k) for k in range(delay + 1)])
    score = score.reshape(delay + 1, m, D, m, D)
    score[0, range(m), :, range(m)] = 0.0
    limit = chance(score.size)
    worst = np.unravel_index(np.argmax(np.abs(score)), score.shape)
    if abs(score[worst]) > limit:
        raise SerpentError(_dependent(worst, float(score[worst]), limit, T))


def _dependent(where: tuple[np.intp, ...], score: float, limit: float, rows: int) -> str:
    k, later, a, prior_runtime, b = (int(index) for index in where)
    other = "itself" if later == prior_runtime else f"input {prior_runtime}"
    when = f"{k} row{'s' if k > 1 else ''} earlier" if k else "in the same row"
    root = np.sqrt(rows - k)
    return (
        f"Input {later} is not independent of {other} {when}: its degree {a + 1} and the other's degree "
        f"{b + 1} correlate {score / root:.3f}, by chance below {limit / root:.3f}; draw every input again "
        "in every row, or keep one row per draw."
    )
