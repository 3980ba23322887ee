"""Average several networks of one kind, and estimate their uncertainty."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.readouts import Progress, Readout, find, part
from serpent_twin.readouts.saved import Rounds, Wanted, inside
from serpent_twin.readouts.windows import Start, Windows
from serpent_twin.stored import many


@dataclass
class Ensemble(Readout):
    """Ours: the mean of several readouts, each trained from its own first weights."""

    name: ClassVar[str] = "ensemble"
    about: ClassVar[str] = "ours: mean of three of our networks"

    members: Annotated[tuple[str, ...], many(1, 20)] = ("residual_mlp", "decoder", "decoder")
    """Names of the readouts"""
    epochs: Rounds | None = None
    """Passes of each member; by default its own"""

    def wanted(self) -> Wanted:
        """The arrays of each member, under its number."""
        wanted: Wanted = {}
        for k, member in enumerate(self._untrained()):
            wanted |= inside(str(k), member.wanted())
        return wanted

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        count = len(self.members)
        for k, (member, own) in enumerate(zip(self._untrained(), rng.spawn(count), strict=True)):

            def on_progress(done: int, most: int, loss: float, before: int = k) -> None:
                progress(before * most + done, count * most, loss)

            member.fit(train, validate, own, on_progress)
            self.learned |= {f"{k}.{name}": value for name, value in member.learned.items()}
            self.history += member.history
            self.stopped_after = self.stopped_after or member.stopped_after

    def _estimate(self, x: Array, start: Start | None) -> Array:
        return np.mean([member.predict(x, start) for member in self._trained()], axis=0)

    def _untrained(self) -> Iterator[Readout]:
        settings = {} if self.epochs is None else {"epochs": self.epochs}
        return (find(name)(self.window, **settings) for name in self.members)

    def _trained(self) -> Iterator[Readout]:
        for k, member in enumerate(self._untrained()):
            member.learned = part(self.learned, str(k))
            yield member
