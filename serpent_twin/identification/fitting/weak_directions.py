"""Name the combinations of parameters of which logs say least, relative to the prior."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.numerals import listed

MOST = 5
"""Directions that are listed"""
UNTOLD = 0.95
"""Ratio of posterior to prior from which directions are alike: any rotation of them is as weak"""
_LARGE = 0.6
"""Loadings that are named, as a share of the largest"""
_PHRASES = 2
"""Kinds of parameters that are named on each side"""
_ROTATIONS = 100
_NUMBER = re.compile(r"\d+")


@dataclass(frozen=True)
class NamedParameter:
    """What a direction's words need of a parameter."""

    name: str
    """Such as `strand stiffness 3+`"""
    unit: str
    """Unit of its standard deviation; `%` of its value where the fit has its logarithm"""


@dataclass(frozen=True)
class WeakDirection:
    """A combination of parameters, by what its prior allows and what the logs leave of that."""

    parameters: str
    """The combination in words, such as `strand stiffness 1–9+ up and strand slack 1–9+ down`"""
    leading: str
    """Name of the parameter with the largest loading"""
    unit: str
    """Unit of the two numbers below"""
    prior: float
    """Standard deviation of the leading parameter along this direction"""
    posterior: float
    """Standard deviation after the logs"""

    @property
    def ratio(self) -> float:
        """Ratio of posterior to prior [1]."""
        return self.posterior / self.prior

    def __str__(self) -> str:
        """The direction as text for a sentence."""
        of = "" if self.leading == self.parameters else f" of {self.leading}"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return (
            f"{self.parameters}: prior {self.prior:.2g}{unit}{of}, logs {self.posterior:.2g}{unit}"
        )


def weakest_directions(
    parameters: Sequence[NamedParameter], prior: Array, posterior: Array, most: int = MOST
) -> tuple[WeakDirection, ...]:
    """The directions of Q parameters in which covariances, (Q, Q), in the parameters' units, differ least.

    With the prior covariance L Lᵀ, these are the eigenvectors of Lᵀ (P⁻¹ − (L Lᵀ)⁻¹) L with the smallest
    eigenvalues h; posterior and prior have the ratio 1/√(1 + h) along each. Of those along which the logs
    say next to nothing any rotation is as weak: they are rotated to few large loadings (varimax, Kaiser
    1958).
    """
    half, width = np.linalg.cholesky(prior), np.sqrt(np.diag(prior))
    gain = half.T @ (np.linalg.inv(posterior) - np.linalg.inv(prior)) @ half
    gain = (gain + gain.T) / 2
    told, along = np.linalg.eigh(gain)
    alike = _ratio(told) > UNTOLD
    if alike.sum() > 1:
        along[:, alike] = along[:, alike] @ _varimax(half @ along[:, alike] / width[:, None])
    ratio = _ratio(np.einsum("ik,ij,jk->k", along, gain, along))
    return tuple(
        _direction(parameters, half @ along[:, k], width, float(ratio[k]))
        for k in np.argsort(-ratio, kind="stable")[:most]
    )


def _ratio(told: Array) -> Array:
    return 1 / np.sqrt(1 + np.maximum(told, 0.0))


def _varimax(loadings: Array) -> Array:
    """The rotation, (k, k), that gives columns of loadings, (Q, k), few large entries each."""
    rotation, before = np.eye(loadings.shape[1]), 0.0
    for _ in range(_ROTATIONS):
        turned = loadings @ rotation
        u, size, v = np.linalg.svd(
            loadings.T @ (turned**3 - turned * np.mean(turned**2, axis=0)), full_matrices=False
        )
        rotation = u @ v
        if size.sum() < before * (1 + 1e-6):
            break
        before = size.sum()
    return rotation


def _direction(
    parameters: Sequence[NamedParameter], change: Array, width: Array, ratio: float
) -> WeakDirection:
    """A direction along which each parameter changes by so much, (Q,), per standard deviation."""
    loading = change / width
    lead = int(np.argmax(np.abs(loading)))
    loading = loading * np.sign(loading[lead])
    large = [k for k in np.argsort(-np.abs(loading)) if abs(loading[k]) >= _LARGE * loading[lead]]
    up, down = (
        in_words([parameters[k].name for k in large if (loading[k] > 0) == rising])
        for rising in (True, False)
    )
    sides = [f"{up} up", f"{down} down"] if down else [up]
    sides = [f"{up} together"] if len(large) > 1 and not down else sides
    of, size = parameters[lead], float(abs(change[lead]))
    return WeakDirection(listed(sides), of.name, of.unit, size, ratio * size)


def in_words(names: Sequence[str]) -> str:
    """Names that differ only in their first number as one, such as `winch radius, motor 1–3 and 5`."""
    alike: dict[str, list[int]] = {}
    for name in names:
        found = _NUMBER.search(name)
        pattern = _NUMBER.sub("\0", name, count=1)
        alike.setdefault(pattern, []).extend([int(found[0])] if found else [])
    phrases = [pattern.replace("\0", _ranges(numbers)) for pattern, numbers in alike.items()]
    more = len(phrases) - _PHRASES
    return listed([*phrases[:_PHRASES], *([f"{more} more"] if more > 0 else [])])


def _ranges(numbers: Sequence[int]) -> str:
    """Whole numbers, runs of three or more joined, such as `1–3, 5`."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    parts = [f"{r[0]}–{r[-1]}" if len(r) > 2 else ", ".join(map(str, r)) for r in runs]
    return ", ".join(parts)
