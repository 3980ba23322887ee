"""Correct the pose on stiff cables linearly from the window."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.readouts import Epoch, Progress, Readout
from serpent_twin.readouts.analytical import stiff_pose
from serpent_twin.readouts.linear import normal_equations, solve, with_one
from serpent_twin.readouts.saved import Penalty, Wanted, numbers
from serpent_twin.readouts.scale import Scale, scale_of
from serpent_twin.readouts.windows import Start, Windows, input_size
from serpent_twin.stored import many


def pose_feature_count(window: int) -> int:
    """Numbers that `pose_features` makes of a window of H rows."""
    return input_size(window) + 27


def pose_features(x: Array) -> Array:
    """The window and the stiff-cable pose, (N, C + 27): sines of the angles for a linear readout."""
    return np.concatenate([x, stiff_pose(x).reshape(-1, 27)], axis=1)


@dataclass
class Residual(Readout):
    """Ours: a ridge from the window and the stiff-cable pose to the residual of that pose."""

    name: ClassVar[str] = "residual"
    about: ClassVar[str] = "ours: ridge on the residual of the stiff-cable pose"

    ridges: Annotated[tuple[Penalty, ...], many(1, 100)] = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
    """Penalties per window to choose from by the validation sessions"""

    def wanted(self) -> Wanted:
        """One weight from each feature, and an offset last, to each coordinate."""
        return {"weight": numbers(pose_feature_count(self.window) + 1, 27)}

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        features = pose_features(train.x)
        scale = scale_of(features)
        blocks = normal_equations(with_one(scale.down(features)), self._target(train))
        for done, ridge in enumerate(self.ridges, 1):
            weight = solve(blocks, ridge * len(features))
            self._consider(_unscaled(weight, scale), validate, ridge)
            progress(done, len(self.ridges), self.history[-1].validation_loss)

    def _consider(self, weight: Array, validate: Windows, ridge: float) -> None:
        """Keep the weights if their validation error is the least so far."""
        error = with_one(pose_features(validate.x)) @ weight - self._target(validate)
        loss = float(np.nanmean(error**2))
        if all(loss < other.validation_loss for other in self.history):
            self.learned["weight"] = weight
        self.history.append(Epoch(np.nan, loss, ridge, 0.0))

    @staticmethod
    def _target(windows: Windows) -> Array:
        return (windows.marker - stiff_pose(windows.x)).reshape(-1, 27)

    def _estimate(self, x: Array, start: Start | None) -> Array:
        features = pose_features(x)
        weight = self.learned["weight"]
        return features[:, -27:] + features @ weight[:-1] + weight[-1]


def _unscaled(weight: Array, scale: Scale) -> Array:
    """Weights for features in their own units, from weights for scaled ones and a one."""
    slope = weight[:-1] / scale.half[:, None]
    return np.concatenate([slope, weight[-1:] - scale.middle @ slope])
