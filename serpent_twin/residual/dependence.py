"""Find the features on which the error depends, and where it shows."""

from dataclasses import dataclass, replace

import numpy as np

from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.features import Feature, features
from serpent_twin.residual.joint_attribution import JointAttribution, attribute_to_joints
from serpent_twin.residual.noise import Noise, measurement_noise
from serpent_twin.residual.scoring import Bank, in_blocks, surrogates
from serpent_twin.residual.shape import Shape, shape_of
from serpent_twin.residual.spectrum import autocorrelation_rows
from serpent_twin.residual.targets import Targets, load_targets, marker_targets

LEAST_SHARE = 0.02  # of a residual's variance that is reported in a sentence
PREFERENCE = {"markers": 0.6, "joint": 1.0, "size": 0.4, "load": 1.0}
"""A single joint is more informative than all markers; an error's size is less informative than its
course."""
ALIKE = 0.85  # of the best feature's share: not distinguished from it


@dataclass(frozen=True, eq=False)
class Dependence:
    """The feature on which a part of the residual depends."""

    target: str
    """The part of the residual: the markers, the rotation at a joint, a motor's load"""
    kind: str
    """markers, joint, size (of the error at a joint or marker) or load"""
    feature: Feature
    """What it follows"""
    share: float
    """Share of the variance explained in segments left out; of all markers', of this motor's load's"""
    share_above_noise: float
    """Share of the variance that is not noise"""
    probability: float
    """Probability that any feature explains as much by chance"""
    shape: Shape
    """Shape of the dependence"""
    index: int
    """Joint, marker or motor of the target, from 0; −1 for all markers together"""
    alternatives: tuple[str, ...] = ()
    """Features that explain nearly as much"""

    @property
    def text(self) -> str:
        """The dependence in a line."""
        several = self.kind == "markers" and self.target.endswith("s")
        verb = "follow" if several else "follows"
        return f"{self.target} {verb} {self.feature.name} {self.shape.text}".strip()


def depends_on(
    comparison: Comparison,
    rng: np.random.Generator,
    permutations: int = 199,
    most: int = 3,
    noise: Noise | None = None,
    found: JointAttribution | None = None,
) -> list[Dependence]:
    """Features on which marker and load residuals depend, the greatest share first; empty if none.

    Each feature predicts segments it was not fitted to. Chance is the best of all features for
    residuals whose segments have been exchanged and reversed; a share that it reaches once in 20
    times, for markers and loads together, is refused. After the best feature, the next is sought in
    what it leaves.
    """
    noise = noise or measurement_noise(comparison)
    found = found or attribute_to_joints(comparison, noise.marker)
    bank = Bank(features(comparison))
    parts = []
    if comparison.has_markers:
        parts.append(marker_targets(comparison, noise, found))
    if comparison.has_loads:
        parts.append(load_targets(comparison, noise))
    level = 0.05 / max(1, len(parts))
    results = [d for t in parts for d in _greedy(bank, t, rng, permutations, most, level)]
    return sorted(results, key=lambda d: -d.share_above_noise * PREFERENCE[d.kind])


def _greedy(
    bank: Bank,
    targets: Targets,
    rng: np.random.Generator,
    permutations: int,
    most: int,
    level: float,
) -> list[Dependence]:
    found: list[Dependence] = []
    left = targets.values
    for _ in range(most):
        best = _best(bank, replace(targets, values=left), rng, permutations, level)
        if best is None or best.share < LEAST_SHARE:
            break
        found.append(best)
        targets = _courses(targets)
        left = _without(left, [d.feature for d in found])
    return found


def _best(
    bank: Bank, targets: Targets, rng: np.random.Generator, permutations: int, level: float
) -> Dependence | None:
    """The feature and target with the greatest share, if it is beyond chance."""
    values = in_blocks(targets.values)
    rows = values.shape[0] * values.shape[1]
    gain = bank.gain(values) @ targets.member.T / rows
    random = bank.gain(surrogates(values, permutations, rng))
    random = random.reshape(len(bank.features), permutations, -1) @ targets.member.T / rows
    # Targets are compared by their ratio to their own chance level.
    chance = random.max(axis=0)
    middle, spread = chance.mean(axis=0), chance.std(axis=0) + 1e-12
    score, by_chance = (gain - middle) / spread, ((chance - middle) / spread).max(axis=1)
    probability = (1 + np.sum(by_chance >= score[..., None], axis=-1)) / (permutations + 1)
    share = np.where(probability <= level, gain / np.maximum(targets.total, 1e-12), 0.0)
    share = share * [PREFERENCE[kind] for kind in targets.kinds]
    at, which = np.unravel_index(int(np.argmax(share)), share.shape)
    if share[at, which] <= 0:
        return None
    return _dependence(bank, targets, gain, int(at), int(which), float(probability[at, which]))


def _courses(targets: Targets) -> Targets:
    """The targets without sizes, whose zero moves once an explanation is subtracted."""
    size = np.array([kind == "size" for kind in targets.kinds])
    return replace(targets, member=targets.member & ~size[:, None])


def _dependence(
    bank: Bank, targets: Targets, gain: Array, at: int, which: int, probability: float
) -> Dependence:
    feature, total = bank.features[at], max(targets.total[which], 1e-12)
    share = min(1.0, gain[at, which] / total)
    clean = max(total - targets.noise[which], 0.05 * total)
    near = np.argsort(-gain[:, which])
    near = near[gain[near, which] >= ALIKE * gain[at, which]]
    others = dict.fromkeys(bank.features[i].name for i in near if i != at)
    others.pop(feature.name, None)
    channels = targets.values[:, :, targets.member[which]]
    error = along(feature, channels)
    independent = error.size / max(1.0, autocorrelation_rows(error[..., None]))
    return Dependence(
        target=targets.names[which],
        kind=targets.kinds[which],
        feature=feature,
        share=float(share),
        share_above_noise=float(min(1.0, gain[at, which] / clean)),
        probability=probability,
        shape=shape_of(feature, error, independent),
        index=_index(targets.kinds, which),
        alternatives=tuple(others)[:3],
    )


def _index(kinds: tuple[str, ...], which: int) -> int:
    return -1 if kinds[which] == "markers" else which - kinds.index(kinds[which])


def along(feature: Feature, channels: Array) -> Array:
    """The combination of channels that follows the feature most, (S, T)."""
    fit = fitted(feature.basis, channels)
    _, axes = np.linalg.eigh(np.einsum("sti,stj->ij", fit, fit))
    return channels @ axes[:, -1]


def _without(values: Array, chosen: list[Feature]) -> Array:
    """Values less what the chosen features explain together."""
    return values - fitted(np.concatenate([f.basis for f in chosen], axis=-1), values)


def fitted(basis: Array, values: Array) -> Array:
    """Ridge fit of values (S, T, C) by a basis (S, T, P), (S, T, C)."""
    x, y = basis.reshape(-1, basis.shape[2]), values.reshape(-1, values.shape[2])
    gram = x.T @ x + 1e-3 * len(x) * np.eye(x.shape[1])
    return (x @ np.linalg.solve(gram, x.T @ y)).reshape(values.shape)
