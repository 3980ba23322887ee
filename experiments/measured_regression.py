"""How far does a regression come that knows no physics, on the same runs?"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from serpent_twin.arm import Array
from serpent_twin.measured import Recording

_RIDGE = 1e-3
_LAGS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8)  # [s]
_SLOW = 0.05  # [rad/s] below which a direction of motion fades
Features = Callable[[Recording], Array]


def _xl330(run: Recording) -> Array:
    """Goals of the last 0.8 s, their sines, each also by the P gain; whether the motor is on."""
    c = run.columns
    rows = [round(lag / np.median(np.diff(c["time"]))) for lag in _LAGS]
    at = np.maximum(np.arange(len(run))[:, None] - rows, 0)
    goal, on = c["goal_position"][at], c["torque_enable"][at]
    base = np.concatenate([goal * on, np.sin(goal) * on, on], axis=1)
    return np.concatenate([base, np.log(run.metadata["kp"]) * base], axis=1)


def _jaw(run: Recording) -> Array:
    """Spindle angle, its square and cube, load, direction of motion, speed, and their products."""
    c = run.columns
    s, load = c["spindle_position"], c["jaw_torque"]
    speed = np.convolve(np.gradient(s, c["time"]), np.full(21, 1 / 21), "same")
    way = np.tanh(speed / _SLOW)
    return np.stack([s, s**2, s**3, load, load * s, way, way * s, way * load, speed], axis=1)


def _jaw_with_torque(run: Recording) -> Array:
    """The same, and the spindle's torque, which the twin has to predict."""
    torque = run.columns["spindle_torque"]
    more = np.stack([torque, torque * run.columns["spindle_position"]], axis=1)
    return np.concatenate([_jaw(run), more], axis=1)


KNOWN: Mapping[str, tuple[str, Mapping[str, Features]]] = {
    "xl330": ("position", {"goals and P gain": _xl330}),
    "jaw": (
        "jaw_position",
        {"what drives the twin": _jaw, "the measured spindle torque besides": _jaw_with_torque},
    ),
}
"""What is predicted for each rig, and from which features"""


def regressions(
    rig: str, training: Sequence[Recording], judging: Sequence[Recording], metric: str
) -> dict[str, float]:
    """Errors on the judging runs, in the metric, by what the regression knows."""
    output, kinds = KNOWN.get(rig, ("", {}))
    return {name: _score(of, output, training, judging, metric) for name, of in kinds.items()}


def _score(
    features: Features,
    output: str,
    training: Sequence[Recording],
    judging: Sequence[Recording],
    metric: str,
) -> float:
    x, y = (
        np.concatenate([f(r) for r in training]) for f in (features, lambda r: r.columns[output])
    )
    middle, scale, offset = x.mean(axis=0), x.std(axis=0) + 1e-9, y.mean()
    z = (x - middle) / scale
    weight = np.linalg.solve(z.T @ z + _RIDGE * len(z) * np.eye(z.shape[1]), z.T @ (y - offset))
    error = np.concatenate(
        [r.columns[output] - offset - (features(r) - middle) / scale @ weight for r in judging]
    )
    size = np.abs(error).mean() if metric == "mae_deg" else np.sqrt((error**2).mean())
    return float(np.degrees(size))
