"""Score a regression without physics on the same runs."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from experiments.measured.metric import TIP_RMS, Metric
from serpent_twin.arrays import Array
from serpent_twin.machines.model.known import STATED
from serpent_twin.machines.model.starts import angle_of, rate_of
from serpent_twin.tables.log import Log
from serpent_twin.tables.smoothing import without_gaps

_RIDGE = 1e-3
_LAGS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8)  # [s]
_SMOOTH = 0.05  # [s] on both sides, over which the spindle's speed is taken
_SLOW = 0.05  # [rad/s] below which a direction of motion fades
_DELAYS = np.linspace(0.0, 0.4, 41)  # [s]
_MOTORS = range(1, 7)  # of the trunk, and of the six-axis robot
_TIP = ("disk3_x", "disk3_y", "disk3_z")
_FREE = 0.4
"""Length of a free run of a pendulum [s]"""
_DOUBLE = ("pos_meas1", "pos_meas2")
_BY_STATE = "where a free run begins, and torques since"
Features = Callable[[Log], Array]
Kinds = Mapping[str, Features]


def _xl330(run: Log) -> Array:
    """Goals of the last 0.8 s, their sines, each also by the P gain; whether the motor is on."""
    c = run.columns
    rows = [round(lag / np.median(np.diff(c["time"]))) for lag in _LAGS]
    at = np.maximum(np.arange(len(run))[:, None] - rows, 0)
    goal, on = c["goal_position"][at], c["torque_enable"][at]
    base = np.concatenate([goal * on, np.sin(goal) * on, on], axis=1)
    return np.concatenate([base, np.log(run.metadata[STATED]["kp"]) * base], axis=1)


def _jaw(run: Log) -> Array:
    """Spindle's turn since the run began, its square and cube, load, direction of motion, speed, products."""
    c = run.columns
    s, load = c["spindle_position"] - c["spindle_position"][0], c["jaw_torque"]
    rows = 2 * round(_SMOOTH / np.median(np.diff(c["time"]))) + 1
    speed = np.convolve(np.gradient(s, c["time"]), np.full(rows, 1 / rows), "same")
    way = np.tanh(speed / _SLOW)
    return np.stack([s, s**2, s**3, load, load * s, way, way * s, way * load, speed], axis=1)


def _jaw_with_torque(run: Log) -> Array:
    """The features of `_jaw` and the spindle's torque, which the twin has to predict."""
    c, torque = run.columns, run.columns["spindle_torque"]
    turned = c["spindle_position"] - c["spindle_position"][0]
    more = np.stack([torque, torque * turned], axis=1)
    return np.concatenate([_jaw(run), more], axis=1)


def _commands(delay: float, degree: int) -> Features:
    """The trunk's six commands, delayed by a time [s], and their products."""

    def features(run: Log) -> Array:
        time = run.columns["time"]
        late = [np.interp(time - delay, time, run.columns[f"motor{n}_command"]) for n in _MOTORS]
        return _products(late, degree)

    return features


def _motor_angles(run: Log) -> Array:
    """Where the trunk's motors were, which the twin has to predict, and products of up to three."""
    return _products([run.columns[f"motor{n}_position"] for n in _MOTORS], 3)


def _tendons(run: Log) -> Array:
    """The nine tendons' displacements, and products of up to three."""
    return _products([values for name, values in run.columns.items() if "servo" in name], 3)


def _motion(joints: Sequence[str], run: Log) -> Array:
    """Angles of some joints as sines and cosines and their products, accelerations, rates and their ways."""
    angle = np.stack([run.columns[angle_of(name)] for name in joints], axis=1)
    rate = np.stack([run.columns[rate_of(name)] for name in joints], axis=1)
    faster = np.gradient(rate, run.columns["time"], axis=0)
    turned = _products([*np.sin(angle.T), *np.cos(angle.T)], 2)
    return np.concatenate([rate, np.tanh(rate / _SLOW), faster, turned], axis=1)


def _goals(run: Log) -> Array:
    """Twelve wanted angles of the last 0.8 s."""
    rows = [round(lag / run.period) for lag in _LAGS]
    at = np.maximum(np.arange(len(run))[:, None] - rows, 0)
    return np.concatenate([run.columns[f"des{n}"][at] for n in range(12)], axis=1)


def _free_runs(angles: Sequence[str], torques: Sequence[str], run: Log) -> Array:
    """Where each free run of 0.4 s begins, and how rates, gravity, friction and torques move it since."""
    rows, row = round(_FREE / run.period), np.arange(len(run))
    begin = row - row % rows
    since = ((row - begin) * run.period)[:, None]
    angle = np.stack([without_gaps(run.columns[name]) for name in angles], axis=1)
    rates: Array = np.asarray(savgol_filter(angle, 9, 3, 1, run.period, axis=0), float)
    first, rate = angle[begin], rates[begin]
    pulled = np.concatenate([np.sin(np.cumsum(first, axis=1)), np.sign(rate)], axis=1)
    given = [_twice_since(run.columns[name], begin, run.period) for name in torques]
    return np.concatenate([first, rate * since, pulled * since**2, np.stack(given, axis=1)], axis=1)


def _twice_since(values: Array, begin: NDArray[np.int64], period: float) -> Array:
    """Integral of an integral of values since a row, (T,)."""
    once = np.cumsum(values) * period
    once = once - once[begin]
    twice = np.cumsum(once) * period
    return twice - twice[begin]


def _products(values: Sequence[Array], degree: int) -> Array:
    """All products of the values up to a degree, (T, features)."""
    chosen = [
        each
        for size in range(1, degree + 1)
        for each in combinations_with_replacement(values, size)
    ]
    return np.stack([np.prod(each, axis=0) for each in chosen], axis=1)


def _trunk(training: Sequence[Log]) -> Kinds:
    """Commands as late as suits a linear map of the training runs best; and motor angles."""

    def left(delay: float) -> float:
        return _score(_commands(delay, 1), _TIP, training, training, TIP_RMS)

    delay = min((float(each) for each in _DELAYS), key=left)
    return {
        f"commands, {delay:.2f} s late, linear": _commands(delay, 1),
        f"commands, {delay:.2f} s late, quadratic": _commands(delay, 2),
        "measured motor angles, cubic": _motor_angles,
    }


KNOWN: Mapping[str, tuple[tuple[str, ...], Callable[[Sequence[Log]], Kinds]]] = {
    "xl330": (("position",), lambda _: {"goals and P gain": _xl330}),
    "jaw": (
        ("jaw_position",),
        lambda _: {
            "what drives the twin": _jaw,
            "the measured spindle torque besides": _jaw_with_torque,
        },
    ),
    "trunk": (_TIP, _trunk),
    "staubli_tx40": (
        tuple(f"curr{n}" for n in _MOTORS),
        lambda _: {
            "angles, rates, accelerations": partial(_motion, [f"joint_{n}" for n in _MOTORS])
        },
    ),
    "kuka_kr300": (
        tuple(f"tau{n}_Nm" for n in _MOTORS),
        lambda _: {"angles, rates, accelerations": partial(_motion, [f"a{n}" for n in _MOTORS])},
    ),
    "go2": (
        tuple(f"q{n}" for n in range(12)),
        lambda _: {"wanted angles of the last 0.8 s": _goals},
    ),
    **dict.fromkeys(
        ("dfki_double_pendulum_a", "dfki_double_pendulum_c"),
        (_DOUBLE, lambda _: {_BY_STATE: partial(_free_runs, _DOUBLE, ("tau_meas1", "tau_meas2"))}),
    ),
    "dfki_simple_pendulum": (
        ("position",),
        lambda _: {_BY_STATE: partial(_free_runs, ("position",), ("torque",))},
    ),
    "opencr": (("tip_x", "tip_y", "tip_z"), lambda _: {"displacements, cubic": _tendons}),
}
"""What is predicted for each rig, and from which features, as training runs suggest them; the last of
several reads what the twin has to predict
"""


def regressions(
    rig: str, training: Sequence[Log], judging: Sequence[Log], metric: Metric
) -> dict[str, float]:
    """Errors on the test runs, in the metric, by the inputs of the regression."""
    if rig not in KNOWN:
        return {}
    outputs, kinds = KNOWN[rig]
    return {
        name: _score(features, outputs, training, judging, metric)
        for name, features in kinds(training).items()
    }


def _score(
    features: Features,
    outputs: Sequence[str],
    training: Sequence[Log],
    judging: Sequence[Log],
    metric: Metric,
) -> float:
    x, y = _all(features, training), _measured(outputs, training)
    known = np.isfinite(y).all(axis=1)
    x, y = x[known], y[known]
    middle, scale, offset = x.mean(axis=0), x.std(axis=0) + 1e-9, y.mean(axis=0)
    z = (x - middle) / scale
    weight = np.linalg.solve(z.T @ z + _RIDGE * len(z) * np.eye(z.shape[1]), z.T @ (y - offset))
    predicted = offset + (_all(features, judging) - middle) / scale @ weight
    return metric.between(_measured(outputs, judging), predicted)


def _all(features: Features, runs: Sequence[Log]) -> Array:
    return np.concatenate([features(run) for run in runs])


def _measured(outputs: Sequence[str], runs: Sequence[Log]) -> Array:
    return _all(lambda run: np.stack([run.columns[name] for name in outputs], axis=1), runs)
