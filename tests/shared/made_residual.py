"""A machine of three places, with a residual that a law makes."""

from types import SimpleNamespace

import numpy as np

from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery.rows_in_time import RowsInTime
from serpent_twin.identification.discovery.screen import screened
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.places import PlaceResponse

S, T, C, M = 6, 160, 5, 4
_DT = 0.25


class Made:
    """A machine of three places and a fit of M parameters, with a residual that a law makes."""

    starts = None

    def __init__(self, law, seed=0, noise=1.0, knows=None):
        rng = np.random.default_rng(seed)
        time = _DT * np.arange(T) + 40 * np.arange(S)[:, None]
        angle = np.sin(0.7 * time + rng.uniform(0, 6, (S, 1))) + 0.2 * rng.standard_normal((S, T))
        self.readings = {
            ("joint_angle", "joint1"): angle,
            ("joint_velocity", "joint1"): np.gradient(angle, _DT, axis=1),
            ("motor_angle", "motor1"): np.cumsum(rng.normal(0, 0.3, (S, T)), axis=1),
            ("motor_angle", "motor2"): 0.4 * np.sin(0.2 * time) + 0.04 * np.sin(3 * time),
            ("time", "session"): time,
            ("runtime", "machine"): time,
        }
        made = (("joint_torque", "joint1", 1), ("slack", "cable1_plus", 1), ("force", "link3", 3))
        self.responses = [
            PlaceResponse(handle, place, rng.standard_normal((d, S, T, C)))
            for handle, place, d in made
        ]
        shown = next(r.change for r in self.responses if r.handle == law.law.handle)
        x = self.readings.get((law.law.reading, law.law.where), np.zeros((S, T)))
        follows = RowsInTime.among(self.readings).followed(
            SHAPES[law.law.shape], x, law.first, law.second
        )
        sizes = [law.size, law.size_y, law.size_z][: len(shown)]
        change = sum(s * follows[..., None] * r for s, r in zip(sizes, shown, strict=True))
        slopes = rng.standard_normal((M, S, T * C)).astype(np.float32)
        if knows is not None:
            slopes[0] = -change.reshape(S, -1)
        residual = (change + noise * rng.standard_normal((S, T, C))).reshape(S, -1)
        priors = [SimpleNamespace(prior=10.0, farthest=np.inf)] * M
        self.case = SimpleNamespace(channels=C, noise=np.ones(C), declared=priors, candidates={})
        self.pieces = SimpleNamespace(measured=np.zeros((S, T, C)))
        free = SimpleNamespace(declared=tuple(range(M)), effects=())
        if knows is not None:
            residual = residual - change.reshape(S, -1)
        self.fit = SimpleNamespace(
            free=type("Free", (), {"__len__": lambda _: M, **vars(free)})(),
            point=ParameterVector(np.zeros(M)),
            residual=residual,
            jacobian=slopes,
            variance_inflation=1.0,
        )

    def found(self):
        return screened(self.case, self.pieces, self.fit, self)
