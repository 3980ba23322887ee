"""Define the number by which a twin, or a regression, is judged."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.residual import Comparison


@dataclass(frozen=True)
class Metric:
    """How large errors are."""

    name: str
    """Name in results.json"""
    short: str
    """Name in a table"""
    words: str
    """Name on an axis"""
    unit: str
    """Unit in which people read it"""
    size: Callable[[Array], float]
    """Size, in `unit`, of errors (..., C) of all C coordinates in rad or m; NaN where nothing was measured"""

    of_all: bool = False
    """Whether all that is measured counts, and not the last of it"""

    def of(self, compared: Comparison) -> float:
        """A twin's error: that of the last marker, be it a tip or the only angle; or of all torques."""
        left = compared.marker_residual
        return self.size(left if self.of_all else left[..., -1, :])

    def between(self, measured: Array, predicted: Array) -> float:
        """A regression's error, of arrays (..., C)."""
        return self.size(measured - predicted)

    def told(self, value: float) -> str:
        """A value with its unit."""
        return f"{value:.2f}{'' if self.unit == '°' else ' '}{self.unit}"


def _mean_angle(error: Array) -> float:
    return float(np.degrees(np.nanmean(np.abs(error))))


def _rms_angle(error: Array) -> float:
    return float(np.degrees(np.sqrt(np.nanmean(error**2))))


def _rms(error: Array) -> float:
    return float(np.sqrt(np.nanmean(error**2)))


def _rms_distance(error: Array) -> float:
    return float(1e3 * np.sqrt(np.nanmean((error**2).sum(axis=-1))))


def _centred_rms_distance(error: Array) -> float:
    return _rms_distance(error - np.nanmean(error.reshape(-1, error.shape[-1]), axis=0))


MAE = Metric("mae_deg", "MAE", "mean absolute error", "°", _mean_angle)
RMSE = Metric("rmse_deg", "RMSE", "root mean square error", "°", _rms_angle)
TIP_RMS = Metric("tip_rms_mm", "tip RMS", "tip's distance, rms", "mm", _rms_distance)

CENTRED_TIP_RMS = Metric(
    "centred_tip_rms_mm",
    "tip RMS, centred",
    "tip's distance, rms, mean offset removed",
    "mm",
    _centred_rms_distance,
)
TORQUE_RMS = Metric(
    "torque_rms_nm", "torque RMS", "torque error of all joints, rms", "N m", _rms, of_all=True
)
JOINTS_MAE = Metric(
    "joints_mae_deg",
    "MAE, all joints",
    "mean absolute error of all joints",
    "°",
    _mean_angle,
    of_all=True,
)
METRICS = {
    metric.name: metric for metric in (MAE, RMSE, TIP_RMS, CENTRED_TIP_RMS, TORQUE_RMS, JOINTS_MAE)
}
