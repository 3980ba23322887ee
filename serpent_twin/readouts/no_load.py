"""Leave the motors' loads out of the published network, to measure what they contribute."""

from dataclasses import dataclass
from typing import ClassVar

from serpent_twin.arrays import Array
from serpent_twin.readouts.mlp import Mlp
from serpent_twin.readouts.windows import columns_without_loads


@dataclass
class NoLoad(Mlp):
    """Published (No-load): the MLP without the loads."""

    name: ClassVar[str] = "no_load"
    about: ClassVar[str] = "published No-load: the MLP without motor loads"

    @property
    def _feature_count(self) -> int:
        return len(columns_without_loads(self.window))

    def _features(self, x: Array) -> Array:
        return x[:, columns_without_loads(self.window)]
