"""Find where on the machine, and in which direction, a part of the error shows."""

import numpy as np

from serpent_twin.numerals import listed
from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.dependence import Dependence, fitted
from serpent_twin.residual.joint_attribution import JointAttribution
from serpent_twin.residual.spectrum import known

_VISIBLE = 0.35  # of the greatest part: it is named


def where(comparison: Comparison, dependence: Dependence, found: JointAttribution | None) -> str:
    """The joints and markers in which the markers follow a feature most, and the axis along which most of
    it lies, in words within a sentence; for a load, its motor.
    """
    if dependence.kind == "load" or not comparison.has_markers:
        return f"in {dependence.target}"
    measure, basis = comparison.marker, dependence.feature.basis
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
    return _sentence(comparison, marker, axis, joint)


def _sentence(comparison: Comparison, marker: Array, axis: str, joint: Array) -> str:
    parts = []
    large = np.flatnonzero(joint > _VISIBLE * joint.max()) if joint.size else []
    if 0 < len(large) <= 4:
        ranked = sorted(large, key=lambda i: -joint[i])
        parts.append("at " + listed([comparison.joint_names[i] for i in ranked]))
    seen = np.flatnonzero(marker > _VISIBLE * marker.max())
    grows = len(seen) > 2 and np.corrcoef(seen, marker[seen])[0, 1] > 0.8
    growing = ", growing outwards" if grows else ""
    parts.append(f"{_span(comparison, seen)}{growing}" + (f", mostly along {axis}" if axis else ""))
    return "; ".join(parts)


def _span(comparison: Comparison, seen: np.ndarray) -> str:
    names = [comparison.marker_names[i] for i in seen]
    together = len(seen) > 2 and np.all(np.diff(seen) == 1)
    return f"seen from {names[0]} to {names[-1]}" if together else f"seen at {listed(names)}"
