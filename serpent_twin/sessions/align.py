"""Map the cameras' clock and frame onto a log's, to a fraction of a frame."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from serpent_twin.arrays import Array
from serpent_twin.hardware.base_frame import Rigid
from serpent_twin.sessions.film import Film, between

SMOOTHED = 0.075  # s: window of the local parabola that gives velocities
DRIFT_STD = 5e-5  # between two quartz clocks, each within some 20 … 50 ppm of the truth
LAG_SHARE = 0.08  # of a prediction's error may look like a delay; 0.06 rms on four other arms
_STEPS = 30


@dataclass(frozen=True)
class Clock:
    """The cameras' clock against the log's: camera time = offset + (1 + drift) × log time."""

    offset: float
    """Camera time at log time 0 [s]."""
    drift: float = 0.0
    """How much faster the cameras' clock runs [1]."""
    offset_std: float = float("nan")
    """Standard error of the offset [s]."""
    drift_std: float = float("nan")
    """Standard error of the drift [1]."""

    def camera_time(self, time: Array) -> Array:
        """Camera times [s] of log times [s]."""
        return self.offset + (1 + self.drift) * time

    def log_time(self, camera_time: Array) -> Array:
        """Log times [s] of camera times [s]."""
        return (camera_time - self.offset) / (1 + self.drift)


def refine(
    time: Array, marker: Array, film: Film, clock: Clock, rigid: Rigid
) -> tuple[Clock, Rigid]:
    """Clock and camera → base transform that bring a labelled film onto the prediction.

    `film` has nine columns, `marker` (K, 9, 3) is predicted at log times (K,). Gauss-Newton on the
    distances, far ones weighted down (Huber), on a film smoothed over a moment. Standard errors are
    a jackknife's over blocks of rows, because neighbouring residuals are alike, and a share for the
    prediction's error that may look like a delay, also like one that grows over the session. The
    drift has the prior 0 ± `DRIFT_STD` of quartz clocks: a short session alone determines it less.
    """
    smooth, velocity = _smoothed(film)
    centre = float(time.mean())
    for _ in range(_STEPS):
        left, slope = _linearised(time, marker, film, clock, rigid, centre, smooth, velocity)
        step = _solve(*_normal(left, slope))
        clock, rigid = _moved_by(clock, rigid, step, centre)
        if np.abs(step[:2]).max() < 1e-7:
            break
    left, slope = _linearised(time, marker, film, clock, rigid, centre, smooth, velocity)
    covariance = _jackknife(time, left, slope)
    rigid = _summed_up(rigid, left)
    speed = float(np.sqrt(np.nanmean((slope[..., 0] ** 2).sum(axis=-1))))
    lag = LAG_SHARE * rigid.residual / speed
    covariance[0, 0] += lag**2
    covariance[1, 1] += (lag / float(time.std())) ** 2
    return _with_errors(clock, covariance[:2, :2], centre), rigid


def _smoothed(film: Film) -> tuple[Array, Array]:
    """Positions and velocities of local parabolas, (T, M, 3) each."""
    window = max(5, 2 * round(SMOOTHED * film.rate_hz / 2) + 1)
    if len(film.position) < window:
        return film.position, np.full_like(film.position, np.nan)
    return _parabola(film, window, 0), _parabola(film, window, 1)


def _parabola(film: Film, window: int, order: int) -> Array:
    from scipy.signal import savgol_coeffs

    step = 1 / film.rate_hz
    kernel = savgol_coeffs(window, 2, deriv=order, delta=step)
    return scipy.ndimage.convolve1d(film.position, kernel, axis=0, mode="constant", cval=np.nan)


def _linearised(
    time: Array,
    marker: Array,
    film: Film,
    clock: Clock,
    rigid: Rigid,
    centre: float,
    smooth: Array,
    velocity: Array,
) -> tuple[Array, Array]:
    """Residuals in the base frame [m], (K, 9, 3), and their Jacobian, (K, 9, 3, 8).

    The unknowns: shift of the clock at log time `centre`, drift, small rotation, translation.
    """
    index = (clock.camera_time(time) - film.start) * film.rate_hz
    at = between(smooth, index) @ rigid.rotation.T
    speed = between(velocity, index) @ rigid.rotation.T
    slope = np.zeros((*marker.shape, 8))
    slope[..., 0] = speed
    slope[..., 1] = speed * (time - centre)[:, None, None]
    x, y, z = np.moveaxis(at, -1, 0)
    slope[..., 0, 3], slope[..., 0, 4] = z, -y
    slope[..., 1, 2], slope[..., 1, 4] = -z, x
    slope[..., 2, 2], slope[..., 2, 3] = y, -x
    slope[..., 5:] = np.eye(3)
    return at + rigid.translation - marker, slope


def _normal(left: Array, slope: Array) -> tuple[Array, Array]:
    """Weighted normal equations of each row: JᵀJ (K, 8, 8) and Jᵀr (K, 8)."""
    far = np.linalg.norm(left, axis=-1)
    known = np.isfinite(far) & np.isfinite(slope).all(axis=(-1, -2))
    limit = 2.0 * np.median(far[known]) if known.any() else 1.0
    weight = np.where(known, np.minimum(1.0, limit / np.maximum(far, 1e-12)), 0.0)
    left, slope = (
        np.where(known[..., None], left, 0.0),
        np.where(known[..., None, None], slope, 0.0),
    )
    weighted = slope * weight[..., None, None]
    return (
        np.einsum("kmxa,kmxb->kab", weighted, slope, optimize=True),
        np.einsum("kmxa,kmx->ka", weighted, left, optimize=True),
    )


def _solve(square: Array, right: Array) -> Array:
    return -np.linalg.lstsq(square.sum(axis=0), right.sum(axis=0), rcond=1e-14)[0]


def _moved_by(clock: Clock, rigid: Rigid, step: Array, centre: float) -> tuple[Clock, Rigid]:
    drift = clock.drift + step[1]
    clock = replace(clock, offset=clock.offset + step[0] - step[1] * centre, drift=drift)
    turn = scipy.spatial.transform.Rotation.from_rotvec(step[2:5]).as_matrix()
    return clock, Rigid(turn @ rigid.rotation, rigid.translation + step[5:])


def _jackknife(time: Array, left: Array, slope: Array) -> Array:
    """Covariance of the unknowns, (8, 8), from leaving out one block of rows after the other."""
    square, right = _normal(left, slope)
    blocks = int(np.clip((time[-1] - time[0]) / 10.0, 10, 60))
    member = np.minimum((np.arange(len(time)) * blocks) // len(time), blocks - 1)
    total_square, total_right = square.sum(axis=0), right.sum(axis=0)
    without = np.array(
        [
            np.linalg.lstsq(
                total_square - square[member == b].sum(axis=0),
                total_right - right[member == b].sum(axis=0),
                rcond=1e-14,
            )[0]
            for b in range(blocks)
        ]
    )
    stray = without - without.mean(axis=0)
    return (blocks - 1) / blocks * stray.T @ stray


def _with_errors(clock: Clock, covariance: Array, centre: float) -> Clock:
    """The clock at log time 0 with its errors, given that clocks drift by 0 ± `DRIFT_STD`."""
    gain = covariance[:, 1] / (covariance[1, 1] + DRIFT_STD**2)
    shift = -gain * clock.drift
    covariance = covariance - np.outer(gain, covariance[1])
    at_zero = np.array([1.0, -centre])
    drift = clock.drift + shift[1]
    offset = clock.offset + shift[0] - shift[1] * centre
    variance = float(at_zero @ covariance @ at_zero)
    return Clock(offset, drift, float(np.sqrt(variance)), float(np.sqrt(covariance[1, 1])))


def _summed_up(rigid: Rigid, left: Array) -> Rigid:
    seen = np.isfinite(left).all(axis=-1)
    square = (left[seen] ** 2).sum(axis=-1)
    return replace(rigid, residual=float(np.sqrt(square.mean())), count=int(seen.sum()))
