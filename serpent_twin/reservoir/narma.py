"""Score a body on NARMA10, with and without a reservoir."""

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.reservoir.leak import taps

ORDER = 10


def narma10(u: Array) -> Array:
    """NARMA10's y(0) … y(T) for inputs u(0) … u(T − 1) in [0, 0.5]; y[1:] is what is due after each input.

    y(t+1) = 0.3 y(t) + 0.05 y(t) Σ_{i=0..9} y(t−i) + 1.5 u(t−9) u(t) + 0.1 (Atiya and Parlos 2000, "New
    results on recurrent network training"); before the first row y and u are 0. Raises SerpentError when
    inputs lie outside, or when the series runs away, as one in ten of 20,000 rows does.
    """
    if not (np.min(u) >= 0 and np.max(u) <= 0.5):
        raise SerpentError(
            f"NARMA10's inputs lie in [{np.min(u):.3g}, {np.max(u):.3g}], its definition's in [0, 0.5]: "
            "scale them."
        )
    past = [0.0] * (ORDER - 1)
    drive, y = (past + u.tolist()), past + [0.0]
    for t in range(ORDER - 1, len(drive)):
        now = y[t]
        product = 1.5 * drive[t - 9] * drive[t]
        y.append(0.3 * now + 0.05 * now * sum(y[t - 9 : t + 1]) + product + 0.1)
        if y[-1] > 10:
            raise SerpentError(
                f"NARMA10 ran away at row {t - ORDER + 1}: draw other inputs, or from [0, 0.45]."
            )
    return np.array(y[ORDER - 1 :])


def nrmse(predicted: Array, target: Array) -> Array:
    """Root mean square error over the target's standard deviation, of each column of (T, …)."""
    return np.sqrt(np.mean((predicted - target) ** 2, axis=0)) / np.std(target, axis=0)


def taps_only(u: Array, target: Array, count: int = 20, washout: int = 200) -> float:
    """NRMSE of a readout of the last `count` inputs alone, of u (T,), for a target (T,).

    After the washout [rows] the first half is for least squares and the other for the error. NARMA10 with
    20 taps: 0.40.
    """
    line = np.column_stack([taps(u, count), np.ones(len(u))])[washout:]
    known, half = target[washout:], (len(u) - washout) // 2
    weight = np.linalg.lstsq(line[:half], known[:half], rcond=None)[0]
    return float(nrmse(line[half:] @ weight, known[half:]))
