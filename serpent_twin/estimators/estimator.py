"""Define what an estimator is: it follows a session, logged or live, row by row."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.belief import Belief, joined, unknown
from serpent_twin.estimators.bus_reading import BusReading, readings
from serpent_twin.estimators.force_filter import FeltForce
from serpent_twin.readouts.trainable import Trainable
from serpent_twin.readouts.windows import SessionWindows

if TYPE_CHECKING:
    from serpent_twin.sim.twin_model import TwinModel

Weighed = dict[str, dict[str, float | str]]
"""Value, standard deviation and unit of parameters by name, ready for JSON"""


class Live(ABC):
    """One session of an estimator, reading by reading."""

    @abstractmethod
    def update(self, now: BusReading) -> Belief | None:
        """The markers now, a belief of one row; None until there are enough readings."""

    def correct(self, marker: Array) -> None:  # noqa: B027 - most learn nothing from markers
        """Learn from the markers measured with the last reading [m], (9, 3), NaN where lost; most estimators
        ignore them.
        """

    def weighed(self) -> Weighed:
        """The arm's parameters identified so far; none, if it identifies none."""
        return {}

    def force(self) -> FeltForce | None:
        """The force on the arm with the last reading; None if it feels none."""
        return None


class Estimator(ABC):
    """Markers and their covariance along a session: `follow` a logged one, `live` one that happens."""

    @property
    @abstractmethod
    def trained(self) -> Trainable:
        """What was trained for it, and is saved: settings, learned arrays, the logs."""

    def follow(self, session: SessionWindows) -> Belief:
        """Markers of all windows of a session, with their covariance; NaN where `live` has none yet."""
        live = self.live(session.log.prior_runtime)
        beliefs = [live.update(now) or unknown() for now in readings(session.log)]
        return joined(beliefs[-len(session) :])

    @abstractmethod
    def live(self, prior_runtime: float = 0.0) -> Live:
        """Follow one session of an arm after `prior_runtime` in earlier sessions [s]; no marker starts it.

        An estimator without a twin ignores the prior runtime.
        """

    @property
    def name(self) -> str:
        """Its name on the command line and in tables."""
        return self.trained.name

    @property
    def warm_up_rows(self) -> int:
        """Readings after which it has estimated once, and so loaded all that it needs."""
        return self.trained.window + 1

    @property
    def states_covariance(self) -> bool:
        """Whether its beliefs have a covariance."""
        return bool(np.isfinite(self.trained.covariance).all())

    @property
    def own_twin(self) -> "TwinModel | None":
        """The twin model of the arm that it simulates; None if it simulates none."""
        return None

    @property
    def takes_twin(self) -> bool:
        """Whether `with_twin` can give it another twin."""
        return False

    def with_twin(self, arm: "TwinModel") -> "Estimator":
        """Copy the estimator with another twin; its covariance stays that of training with its own."""
        raise SerpentError(
            f"the readout {self.name} has no twin that could be replaced. Give a trained observer."
        )

    def require_rate(self, rate_hz: float) -> None:
        """Refuse rows that are not as far apart as those it was trained on, if that matters to it."""
        self.trained.require_rate(rate_hz)


@dataclass
class TrainedEstimator(Trainable, Estimator):
    """An estimator that is trained and saved itself; a file that defines one adds it to the registry."""

    @property
    def trained(self) -> Self:
        """The estimator itself."""
        return self
