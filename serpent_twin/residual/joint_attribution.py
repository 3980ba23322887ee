"""Find the joint at which the marker error arises."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.residual.comparison import Array, Comparison


@dataclass(frozen=True, eq=False)
class JointAttribution:
    """The marker residual as small rotations of the joints."""

    rotation: Array
    """Additional rotation of each joint that explains the markers [rad], (S, T, J)"""
    resolved: Array
    """Share of a true rotation at each joint that `rotation` shows, the noise being what it is, (J,)"""
    lever: Array
    """Root mean square over rows and markers of what one rad moves [m/rad], (J,)"""
    share: Array
    """Share of the markers' squared residual that each joint's rotation accounts for, (J,)"""


def joint_jacobian(comparison: Comparison) -> Array:
    """What a small rotation of each joint moves [m/rad], (S, T, M, 3, J)."""
    anchor, axis = comparison.joint_anchor, comparison.joint_axis
    predicted = comparison.marker_predicted
    assert anchor is not None and axis is not None and predicted is not None
    arm = predicted[:, :, :, None] - anchor[:, :, None]
    turn = np.cross(axis[:, :, None], arm)
    J, M = anchor.shape[2], predicted.shape[2]
    carries = comparison.carries
    if carries is None:
        carries = np.arange(M)[None, :] >= np.arange(J)[:, None]
    return np.moveaxis(turn * carries.T[:, :, None], 3, 4)


def attribute_to_joints(
    comparison: Comparison, noise: Array | float, rounds: int = 12
) -> JointAttribution | None:
    """Joint rotations that explain the marker residual; None without markers or joint geometry.

    Each joint's rotations have a gaussian prior whose width is learned from all rows (automatic
    relevance determination), so an error at one joint is not smeared over its neighbours.
    `noise` is the standard deviation of a coordinate [m], one number or (M,), NaN where unknown.
    """
    if not comparison.has_markers or comparison.joint_anchor is None:
        return None
    residual = comparison.marker_residual
    S, T, M, _ = residual.shape
    std = np.broadcast_to(np.fmax(noise, 1e-5), (M,))
    weight = np.where(np.isfinite(residual), 1 / std[:, None], 0.0).reshape(S, T, 3 * M)
    H = joint_jacobian(comparison).reshape(S, T, 3 * M, -1)
    y = np.nan_to_num(residual).reshape(S, T, 3 * M)
    gram = np.einsum("stk,stki,stkj->stij", weight**2, H, H, optimize=True)
    right = np.einsum("stk,stki->sti", weight**2 * y, H, optimize=True)
    width = np.full(H.shape[-1], np.nanmean(residual**2) / np.mean(H**2))
    rotation, covariance = np.zeros_like(right), np.zeros_like(gram)
    for _ in range(rounds):
        covariance = np.linalg.inv(gram + np.diag(1 / np.maximum(width, 1e-14)))
        rotation = np.einsum("stij,stj->sti", covariance, right)
        spread = np.diagonal(covariance, axis1=2, axis2=3)
        width = np.mean(rotation**2 + spread, axis=(0, 1))
    resolved = np.einsum("stij,stji->i", covariance, gram, optimize=True) / (S * T)
    moved = np.where(weight[..., None] > 0, H * rotation[..., None, :], 0.0)
    share = np.einsum("stkj,stk->j", moved, y) / max(float(np.sum(y**2)), 1e-300)
    lever = np.sqrt(np.mean(H**2, axis=(0, 1, 2)) * 3)
    return JointAttribution(rotation, resolved, lever, share)
