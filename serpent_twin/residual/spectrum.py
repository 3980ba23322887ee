"""Find oscillations of the error, and its correlation time."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array, known_mean


@dataclass(frozen=True)
class Line:
    """An oscillation that keeps its phase over a segment."""

    frequency_hz: float
    """Its frequency, below half the row rate"""
    share: float
    """Share of the residual's variance, noise excluded"""


def spectrum(values: Array, period: float) -> tuple[Array, Array]:
    """Welch's spectrum of values (S, T, C), rows `period` [s] apart, averaged over segments: frequencies
    [Hz] and power [unit²/Hz] summed over channels, (F,) each.
    """
    from scipy.signal import welch

    rows = known(values)
    frequency, power = welch(rows, 1 / period, nperseg=min(rows.shape[1], 128), axis=1)
    return frequency, power.sum(axis=-1).mean(axis=0)


def known(values: Array) -> Array:
    """Values (S, T, C) without their mean over all rows; NaN becomes zero."""
    return np.where(np.isfinite(values), values - known_mean(values, (0, 1)), 0.0)


def autocorrelation_rows(values: Array) -> float:
    """Rows after which the autocorrelation of values (S, T, C) is below 1/e; at most T."""
    T = values.shape[1]
    power = np.abs(np.fft.rfft(values, 2 * T, axis=1)) ** 2
    covariance = np.fft.irfft(power.sum(axis=(0, 2)))[:T] / np.arange(T, 0, -1)
    if covariance[0] <= 0:
        return 0.0
    below = np.flatnonzero(covariance < covariance[0] / np.e)
    return float(below[0]) if below.size else float(T)


def line(
    values: Array, period: float, rng: np.random.Generator, permutations: int = 199
) -> Line | None:
    """The most coherent oscillation in values (S, T, C), if chance exceeds it less than once in 100.

    Each segment is cut into eight blocks; an oscillation adds up over them in phase. The chance level
    is found by giving the blocks random signs, over all frequencies alike.
    """
    block = _blocks(known(values))
    S, B = block.shape[:2]
    rows = values.shape[1]
    padded = 1 << int(np.ceil(np.log2(2 * rows)))
    # Blocks keep their place in time, so that their phases can be compared.
    wave = np.stack([_wave(block[:, b], b, padded) for b in range(B)], axis=1)
    frequency = np.fft.rfftfreq(padded, period)
    wanted = frequency >= 1.5 * B / (rows * period)
    wave, frequency = wave[:, :, wanted], frequency[wanted]
    alone = (np.abs(wave) ** 2).sum(axis=(0, 1, 3))
    together = (np.abs(wave.sum(axis=1)) ** 2).sum(axis=(0, 2))
    if not alone.any():
        return None
    sign = rng.choice([-1.0, 1.0], (permutations, S, B))
    chance = np.stack([_coherent(wave, s) for s in sign])
    spread = chance.std(axis=0) + 1e-3 * alone.mean()
    score, by_chance = (together - alone) / spread, ((chance - alone) / spread).max(axis=1)
    best = int(np.argmax(score))
    probability = (1 + np.sum(by_chance >= score[best])) / (permutations + 1)
    if probability > 0.01:
        return None
    energy = 2 / rows * B / (B - 1) * (together - alone)[best]
    share = energy / (np.sum(block**2) or 1.0)
    return Line(float(frequency[best]), float(np.clip(share, 0, 1)))


def _coherent(wave: np.ndarray, sign: Array) -> Array:
    """Power [unit²] at each frequency of waves (S, B, F, C) added with signs (S, B), (F,)."""
    S, B, F, C = wave.shape
    total = sign[:, None, :] @ wave.reshape(S, B, F * C)
    return (np.abs(total.reshape(S, F, C)) ** 2).sum(axis=(0, 2))


def _blocks(values: Array, blocks: int = 8) -> Array:
    """Values (S, T, C) cut into blocks without their means and trends, (S, B, T / B, C)."""
    S, T, C = values.shape
    length = T // blocks
    cut = values[:, : blocks * length].reshape(S, blocks, length, C)
    ramp = np.stack([np.ones(length), np.linspace(-1, 1, length)], axis=1)
    q, _ = np.linalg.qr(ramp)
    return cut - q @ (q.T @ cut)


def _wave(block: Array, index: int, padded: int) -> np.ndarray:
    """Fourier transform of a block (S, L, C) at its time in the segment, (S, F, C)."""
    S, L, C = block.shape
    rows = np.zeros((S, padded, C))
    rows[:, index * L : (index + 1) * L] = block
    return np.fft.rfft(rows, axis=1)
