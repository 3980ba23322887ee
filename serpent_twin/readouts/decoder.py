"""Estimate joint angles by a network, and decode them to markers by the chain of joints."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, joint_from_motor, markers
from serpent_twin.arrays import Array
from serpent_twin.readouts.linear import ridge_weights, with_one
from serpent_twin.readouts.network import forward
from serpent_twin.readouts.regression import Regression
from serpent_twin.readouts.residual import pose_features
from serpent_twin.readouts.residual_mlp import ResidualMlp
from serpent_twin.readouts.saved import Penalty, Wanted, layer_weights, numbers
from serpent_twin.readouts.scale import spread_of
from serpent_twin.readouts.windows import Windows, motor_angles

if TYPE_CHECKING:
    from torch import nn


@dataclass
class Decoder(ResidualMlp):
    """Ours: a ridge and a network correct the joint angles, forward kinematics makes the markers.

    The markers' places in the links are learned, too, and nine small vectors for the part that no
    joint angle explains.
    """

    name: ClassVar[str] = "decoder"
    about: ClassVar[str] = "ours: network → joint angles → forward kinematics"

    ridge: Penalty = 1e-7
    """Penalty of the ridge per window"""

    def wanted(self) -> Wanted:
        """The scales, the ridge of the joint angles, the network and the markers' places."""
        return Regression.wanted(self)

    def _weights(self) -> Wanted:
        count = self._feature_count
        joints = {"joint_weight": numbers(count + 1, N_JOINTS), "joint_half": numbers(N_JOINTS)}
        network = layer_weights([count, *[self.width] * self.layers, N_JOINTS + 27])
        return joints | network | {"place": numbers(N_JOINTS, 3)}

    def _prepare(self, train: Windows, validate: Windows, rng: np.random.Generator) -> None:
        features = spread_of(pose_features(train.x))
        self._remember("x", features)
        stiff = joint_from_motor(motor_angles(train.x))
        lacking = joint_angles(train.marker, stiff) - stiff
        scaled = with_one(features.down(pose_features(train.x)))
        self.learned["joint_weight"] = ridge_weights(scaled, lacking, self.ridge)
        self.learned["joint_half"] = np.nanstd(
            lacking - scaled @ self.learned["joint_weight"], axis=0
        )
        angle = self._inputs(train.x)[:, :N_JOINTS]
        error = spread_of((train.marker - markers(angle)).reshape(-1, 27), common=True)
        self._remember("y", replace(error, middle=np.zeros(27)))

    def _base(self, x: Array) -> Array:
        return np.zeros((len(x), 27))

    def _inputs(self, x: Array) -> Array:
        """Joint angles by the ridge and scaled features, (N, 9 + C)."""
        scaled = super()._inputs(x)
        correction = with_one(scaled) @ self.learned["joint_weight"]
        return np.concatenate([joint_from_motor(motor_angles(x)) + correction, scaled], axis=1)

    def _make(self, inputs: int) -> "nn.Module":
        from serpent_twin.readouts.network.modules import ChainModule, MlpModule

        network = MlpModule(inputs - N_JOINTS, self.width, self.layers, N_JOINTS + 27, "silu")
        return ChainModule(network, self.learned["joint_half"], self.learned["y_half"])

    def _forward(self, inputs: Array) -> Array:
        answer = forward.mlp(inputs[:, N_JOINTS:], self.learned, "silu").astype(float)
        angle = inputs[:, :N_JOINTS] + self.learned["joint_half"] * answer[:, :N_JOINTS]
        moved = self.learned["place"] * self.learned["y_half"].reshape(N_JOINTS, 3)
        arm = replace(ARM, marker=tuple(map(tuple, ARM.markers_in_links + moved)))
        return markers(angle, arm).reshape(-1, 27) / self.learned["y_half"] + answer[:, N_JOINTS:]


def joint_angles(marker: Array, guess: Array, iterations: int = 8) -> Array:
    """Joint angles [rad], (N, 9), that explain the markers (N, 9, 3): Gauss-Newton from a guess.

    NaN for rows that show not all markers or that were not explained to within a centimetre.
    """
    step, prior = 1e-6, (1e-3 / 0.3) ** 2  # (error of a marker [m] / error of the guess [rad])²
    wanted, angle = marker.reshape(-1, 27), guess.copy()
    for _ in range(iterations):
        now = markers(angle).reshape(-1, 27)
        moved = [markers(angle + step * axis).reshape(-1, 27) for axis in np.eye(N_JOINTS)]
        jacobian = np.stack([(m - now) / step for m in moved], axis=2)
        transposed = jacobian.swapaxes(1, 2)
        error = np.where(np.isfinite(wanted), wanted - now, 0.0)
        right = (transposed @ error[..., None])[..., 0] + prior * (guess - angle)
        normal = transposed @ jacobian + prior * np.eye(N_JOINTS)
        angle += np.linalg.solve(normal, right[..., None])[..., 0]
    explained = (np.linalg.norm(markers(angle) - marker, axis=-1) < 0.01).all(axis=1)
    return np.where(explained[:, None], angle, np.nan)
