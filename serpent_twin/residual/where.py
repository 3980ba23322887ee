"""Find where on the machine, and in which direction, a part of the error shows."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.numerals import listed
from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.dependence import Dependence, fitted
from serpent_twin.residual.joint_attribution import JointAttribution
from serpent_twin.residual.spectrum import known

VISIBLE = 0.35  # of the greatest part: it is named


@dataclass(frozen=True, eq=False)
class Where:
    """The part of the marker residual that follows a feature, by marker and joint."""

    marker: Array
    """Root mean square of each marker's part, in the unit of the markers' measure, (M,)"""
    axis: str
    """Axis along which most of it lies, or nothing"""
    joint_mm: Array
    """By each joint's rotation, as far as it moves the markers [mm], (J,); empty without geometry"""
    text: str
    """In words, within a sentence"""


def where(comparison: Comparison, dependence: Dependence, found: JointAttribution | None) -> Where:
    """Where the markers follow a feature; for a load, only its motor is named."""
    if dependence.kind == "load" or not comparison.has_markers:
        M, J = comparison.marker_residual.shape[2], len(comparison.joint_names)
        return Where(np.zeros(M), "", np.zeros(J), f"in {dependence.target}")
    return where_along(comparison, dependence.feature.basis, found)


def where_along(comparison: Comparison, basis: Array, found: JointAttribution | None) -> Where:
    """Where the markers follow a basis (S, T, P)."""
    measure = comparison.marker
    residual = measure.scale * known(comparison.marker_residual.reshape(*comparison.time.shape, -1))
    each = fitted(basis, residual).reshape(
        -1, residual.shape[2] // measure.dimension, measure.dimension
    )
    by_axis = np.mean(each**2, axis=0)
    marker = np.sqrt(by_axis.sum(axis=1))
    share = by_axis.sum(axis=0) / max(by_axis.sum(), 1e-300)
    axis = measure.axes[int(share.argmax())] if measure.axes and share.max() > 0.6 else ""
    joint = np.zeros(0)
    if found is not None:
        turns = 1e3 * known(found.rotation * found.lever)
        joint = np.sqrt(np.mean(fitted(basis, turns) ** 2, axis=(0, 1)))
    return Where(marker, axis, joint, _sentence(comparison, marker, axis, joint))


def _sentence(comparison: Comparison, marker: Array, axis: str, joint: Array) -> str:
    parts = []
    large = np.flatnonzero(joint > VISIBLE * joint.max()) if joint.size else []
    if 0 < len(large) <= 4:
        ranked = sorted(large, key=lambda i: -joint[i])
        parts.append("at " + listed([comparison.joint_names[i] for i in ranked]))
    seen = np.flatnonzero(marker > VISIBLE * marker.max())
    grows = len(seen) > 2 and np.corrcoef(seen, marker[seen])[0, 1] > 0.8
    growing = ", growing outwards" if grows else ""
    parts.append(f"{_span(comparison, seen)}{growing}" + (f", mostly along {axis}" if axis else ""))
    return "; ".join(parts)


def _span(comparison: Comparison, seen: np.ndarray) -> str:
    names = [comparison.marker_names[i] for i in seen]
    together = len(seen) > 2 and np.all(np.diff(seen) == 1)
    return f"seen from {names[0]} to {names[-1]}" if together else f"seen at {listed(names)}"
