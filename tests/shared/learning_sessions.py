"""Sessions of which it is known what a readout can learn."""

import numpy as np
import torch
from scipy.signal import lfilter

from serpent_twin import sessions
from serpent_twin.arm import geometry
from serpent_twin.readouts import windows as win

torch.set_num_threads(1)  # networks this small only wait for a second thread
QUIET = lambda *_: None  # noqa: E731


def make_session(
    number: int, rows: int = 400, give: float = 0.3, lost: float = 0.0
) -> sessions.Session:
    """An arm whose joints give way to the motors' loads: q = A⁻¹ m + give × load, known to be so."""
    rng = np.random.default_rng(number)
    clock = np.arange(rows) / 4
    phase, speed = rng.uniform(0, 6, (2, 10))
    joint = 0.3 * np.sin((0.3 + 0.1 * speed) * clock[:, None] + phase)
    motor = np.cumsum(joint, axis=1)
    load = 0.1 * np.sin((0.5 + 0.1 * phase) * clock[:, None] + speed)
    marker = geometry.markers(joint[:, :9] + give * load[:, :9])
    marker[rng.random((rows, 9)) < lost] = np.nan
    return sessions.Session(
        None,
        {
            "schema_version": 1,
            "backend": "sim",
            "arm": "x",
            "session": number,
            "rate_hz": 4.0,
        },
        {
            "time": clock,
            "motor_position": motor,
            "motor_velocity": (speed := np.gradient(motor, 0.25, axis=0)),
            "motor_load": load,
            "motor_velocity_command": speed + rng.normal(0, 0.01, (rows, 10)),
            "joint_target": joint[:, :9],
            "marker": marker,
        },
    )


def make_windows(numbers: range, window: int = 4, **kwargs: float) -> win.Windows:
    return win.cut([make_session(n, **kwargs) for n in numbers], window, drop=10)  # type: ignore


def wandering(
    number: int, rows: int = 400, give: float = 0.3, lost: float = 0.0
) -> sessions.Session:
    """Session driven as in the protocol: new random targets every five rows, so any stretch shows all."""
    rng = np.random.default_rng(number)
    joint, load = (
        lfilter([0.4], [1, -0.6], np.repeat(rng.uniform(-s, s, (rows // 5, 10)), 5, axis=0), axis=0)
        for s in (0.4, 0.15)
    )
    motor = np.cumsum(joint, axis=1)
    marker = geometry.markers(joint[:, :9] + give * load[:, :9])
    marker[rng.random((rows, 9)) < lost] = np.nan
    velocity = np.gradient(motor, 0.25, axis=0)
    return make_session(number, rows).having(
        motor_position=motor,
        motor_velocity=velocity,
        motor_load=load,
        motor_velocity_command=velocity + rng.normal(0, 0.01, (rows, 10)),
        marker=marker,
    )
