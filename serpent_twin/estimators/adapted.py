"""Correct a trained readout for another arm."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import kind_of
from serpent_twin.estimators.belief import Belief
from serpent_twin.estimators.bus_reading import BusReading
from serpent_twin.estimators.estimator import Estimator, Live, TrainedEstimator
from serpent_twin.estimators.windowed import RecentWindow
from serpent_twin.numerals import counted
from serpent_twin.readouts import Epoch, Progress, part
from serpent_twin.readouts.analytical import stiff_pose
from serpent_twin.readouts.covariance import covariance_of, growth, root_of
from serpent_twin.readouts.linear import Block, normal_equations, solve, with_one
from serpent_twin.readouts.saved import (
    Penalty,
    Wanted,
    configured,
    covariances,
    divisors,
    inside,
    numbers,
)
from serpent_twin.readouts.scale import Scale, spread_of
from serpent_twin.readouts.score import distances
from serpent_twin.readouts.trainable import Trainable
from serpent_twin.readouts.windows import COMMAND, STATE, SessionWindows, Windows
from serpent_twin.stored import many, naming, within

if TYPE_CHECKING:
    from serpent_twin.sim.twin_model import TwinModel

BLOCKS = 10
FREE, HELD = 1e-9, 1e12
"""The penalty that leaves a weight free, and the penalty that makes it zero"""
SHARP = 5.0
"""Motion has a direction above a fifth of its usual speed; larger thresholds did worse on logged arms"""


@dataclass
class Adapted(TrainedEstimator):
    """Ours: a trained readout, unchanged, and a ridge on its residual in windows of another arm.

    Cross-validation over contiguous blocks of these windows chooses the penalty, by the mean marker distance;
    the offset alone is among its choices. If the gain does not exceed its standard error over the blocks,
    there is no correction. The validation windows are not used.
    """

    name: ClassVar[str] = "adapted"
    about: ClassVar[str] = "ours: a trained readout, corrected for the arm"

    base: str = field(kw_only=True)
    """Name of the readout that is corrected"""
    settings: dict[str, Any] = field(kw_only=True)
    """Its settings"""
    penalties: Annotated[tuple[Penalty, ...], many(1, 100)] = tuple(10.0**k for k in range(-6, 3))
    """Penalties per window to choose from"""
    blocks: Annotated[int, within(2, 1000)] = BLOCKS
    """Blocks of consecutive windows, each of which is the test once"""

    @classmethod
    def of(cls, base: Estimator) -> Self:
        """A correction to learn for a trained readout."""
        trained = base.trained
        adapted = cls(trained.window, base=base.name, settings=trained.config())
        adapted.corrects = base
        return adapted

    @cached_property
    def corrects(self) -> Estimator:
        """The estimator that is corrected, as it was trained."""
        base = self._untrained()
        base.learned = part(self.learned, "base")
        base.covariance = self.learned["base_covariance"]
        rate = float(self.learned["base_rate_hz"])
        base.rate_hz = rate if np.isfinite(rate) else None
        return kind_of(self.base).following(base)

    @property
    def own_twin(self) -> "TwinModel | None":
        """The twin model of the corrected readout, if it has one."""
        return self.corrects.own_twin

    def wanted(self) -> Wanted:
        """The arrays of the base, and the correction with the scales of its features."""
        count = self._feature_count
        base = inside("base", self._untrained().wanted()) | {
            "base_covariance": covariances(N_JOINTS, unknown=True),
            "base_rate_hz": numbers(low=0.0, unknown=True),
        }
        return base | {
            "turn": divisors(self.window - 1, N_JOINTS),
            "middle": numbers(count),
            "half": divisors(count),
            "weight": numbers(count + 1, 27),
            "penalty": numbers(2, low=0.0),
            "spread": covariances(N_JOINTS),
            "covariance": covariances(N_JOINTS),
        }

    def _untrained(self) -> Trainable:
        """What the corrected estimator is trained for, untrained."""
        with naming("config.base"):
            kind = kind_of(self.base).trained
        return configured(kind, self.settings, ("config", "settings"))

    @property
    def _feature_count(self) -> int:
        """Columns of `_features`: a state, H − 1 changes, directions and commands, and a pose."""
        return STATE + (self.window - 1) * (STATE + N_JOINTS + COMMAND) + 27

    def follow(self, session: SessionWindows) -> Belief:
        """Markers of all windows of a session, with their covariance."""
        return self.corrected(self.corrects.follow(session), session.x)

    def live(self, prior_runtime: float = 0.0) -> "LiveAdapted":
        """An estimator for one session of an arm after `prior_runtime` in earlier sessions [s]; no marker
        starts it.
        """
        return LiveAdapted(self, prior_runtime)

    def corrected(self, belief: Belief, x: Array) -> Belief:
        """The base's estimate of windows x, (N, 27H − 9), corrected."""
        root = root_of(belief.covariance)
        spread = root @ self.learned["spread"] @ np.swapaxes(root, -1, -2)
        return Belief(belief.marker + self._correction(x), spread)

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        base = self.corrects.trained
        self._require(train, base)
        self.trained_on = tuple(dict.fromkeys((*base.trained_on, *train.sources("train"))))
        self.stopped_after = base.stopped_after
        self.learned = {f"base.{name}": value for name, value in base.learned.items()} | {
            "base_covariance": base.covariance,
            "base_rate_hz": np.array(base.rate_hz or np.nan),
        }
        told = [self.corrects.follow(session) for session in train.sessions]
        miss = (train.marker - np.concatenate([each.marker for each in told])).reshape(-1, 27)
        features = self._fit_features(train.x)
        with threadpool_limits(
            1, "blas"
        ):  # of many small systems, threads only wait for each other
            folds = Folds(features, miss, self.blocks, self.window)
            best = self._choose(folds, progress)
            left, weight = folds.left(best).reshape(-1, N_JOINTS, 3), folds.weight(best)
        root = root_of(np.concatenate([each.covariance for each in told]))
        few = growth(len(features) / self.window)  # windows of H rows overlap
        self.learned |= {
            "penalty": np.array(best),
            "weight": weight,
            "spread": few * covariance_of(np.linalg.solve(root, left[..., None])[..., 0]),
            "covariance": few * covariance_of(left),
        }

    def _choose(self, folds: "Folds", progress: Progress) -> tuple[float, float]:
        """Penalties of slopes and offset with the least error, none if the gain is not significant."""
        choices = [(p, FREE) for p in (*self.penalties, HELD)] + [(HELD, HELD)]
        distance = []
        for done, choice in enumerate(choices, 1):
            distance.append(folds.distance(choice))
            self.history.append(Epoch(np.nan, float(distance[-1].mean()), choice[0], 0.0))
            progress(done, len(choices), self.history[-1].validation_loss)
        best, nothing = int(np.argmin(np.mean(distance, axis=1))), len(choices) - 1
        gain = distance[nothing] - distance[best]
        beyond_chance = gain.mean() > gain.std(ddof=1) / np.sqrt(len(gain))
        return choices[best if beyond_chance else nothing]

    def _require(self, train: Windows, base: Trainable) -> None:
        least = self.blocks * self.window
        if len(train.x) < least:
            raise SerpentError(
                f"{counted(len(train.x), 'window is', 'windows are')} too few to adapt a readout: "
                f"give at least {least}, or none."
            )
        if not np.isfinite(train.marker).any():
            raise SerpentError("the windows to adapt to show no marker, so nothing can be learned.")
        if train.rate_hz is not None:
            base.require_rate(train.rate_hz)

    def _fit_features(self, x: Array) -> Array:
        turn = np.sqrt(np.mean(self._changes(x)[..., :N_JOINTS] ** 2, axis=0))
        self.learned["turn"] = np.where(turn > 0, turn, 1.0) / SHARP
        scale = spread_of(self._features(x))
        self.learned |= {"middle": scale.middle, "half": scale.half}
        return self._scaled(x)

    def _scaled(self, x: Array) -> Array:
        scale = Scale(self.learned["middle"], self.learned["half"])
        return with_one(scale.down(self._features(x)))

    def _features(self, x: Array) -> Array:
        """The newest row, the changes from row to row, their directions, commands, stiff cables' pose.

        The window itself and that pose, and the direction of each motor, expressed by changes, so that a
        penalty does not act most on the differences between rows.
        """
        changes = self._changes(x)
        direction = np.tanh(changes[..., :N_JOINTS] / self.learned["turn"])
        rest = x[:, STATE * self.window :], stiff_pose(x)
        parts = x[:, :STATE], changes, direction, *rest
        return np.concatenate([each.reshape(len(x), -1) for each in parts], axis=1)

    def _changes(self, x: Array) -> Array:
        state = x[:, : STATE * self.window].reshape(len(x), self.window, STATE)
        return state[:, :-1] - state[:, 1:]

    def _correction(self, x: Array) -> Array:
        return (self._scaled(x) @ self.learned["weight"]).reshape(-1, N_JOINTS, 3)

    def _spread(self, validate: Windows) -> Array:
        return self.learned["covariance"]


def least_windows(window: int) -> int:
    """The least number of windows of H rows to learn from."""
    return BLOCKS * window


class LiveAdapted(Live):
    """An adapted readout in one session, a reading at a time."""

    def __init__(self, adapted: Adapted, prior_runtime: float = 0.0) -> None:
        self._adapted = adapted
        self._base: Live = adapted.corrects.live(prior_runtime)
        self._recent = RecentWindow(adapted.window, adapted.rate_hz)

    def update(self, now: BusReading) -> Belief | None:
        """The markers now; None before H readings."""
        belief, x = self._base.update(now), self._recent.add(now)
        if belief is None or x is None:
            return None
        return self._adapted.corrected(belief, x)


class Folds:
    """Ridges from x (N, C), a one last, to y (N, 27): each block is predicted from the windows that are not
    within `gap` of it.
    """

    def __init__(self, x: Array, y: Array, count: int, gap: int) -> None:
        self.x, self.y = x, y
        self.folds: list[tuple[slice, int, list[Block]]] = []
        for judge, learn in _blocks(len(x), count, gap):
            self.folds.append((judge, len(learn), normal_equations(x[learn], y[learn])))

    def left(self, penalty: tuple[float, float]) -> Array:
        """The residual of y in each block, for penalties of slopes and offset per window."""
        left, each = np.empty_like(self.y), self._each(penalty)
        for judge, rows, equations in self.folds:
            left[judge] = self.y[judge] - self.x[judge] @ solve(equations, each * rows)
        return left

    def distance(self, penalty: tuple[float, float]) -> Array:
        """Mean distance of the measured markers in each block that has some [m]."""
        left = distances(self.left(penalty).reshape(-1, N_JOINTS, 3), np.zeros(3))
        blocks = [left[judge] for judge, _, _ in self.folds]
        return np.array([np.nanmean(block) for block in blocks if np.isfinite(block).any()])

    def weight(self, penalty: tuple[float, float]) -> Array:
        """Weights, (C, 27), fitted to all windows."""
        return solve(normal_equations(self.x, self.y), self._each(penalty) * len(self.x))

    def _each(self, penalty: tuple[float, float]) -> Array:
        slope, offset = penalty
        return np.r_[np.full(self.x.shape[1] - 1, slope), offset]


def _blocks(rows: int, count: int, gap: int) -> Iterator[tuple[slice, NDArray[np.intp]]]:
    """Rows of each block, and the rows to fit to for it."""
    edges = np.linspace(0, rows, count + 1).astype(int)
    for first, end in itertools.pairwise(edges.tolist()):
        near = slice(max(0, first - gap), end + gap)
        yield slice(first, end), np.delete(np.arange(rows), near)
