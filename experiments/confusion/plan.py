"""Plan which arms the confusion experiment builds, and in which order.

Round by round, so that a run which ends early leaves a balanced table: every round has each effect
once at one strength, clean arms, one pair, and each effect outside the catalogue.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CLEAN, KNOWN, PAIR, OUTSIDE = "clean", "known", "pair", "outside"
LEVELS = (1.0, 0.5, 2.0, 0.25, 0.125)
"""Strength of each round, in typical strengths; the rounds go through them over and over"""
CLEAN_A_ROUND = 2
_OTHERS_LEVEL = 2.0  # of effects outside the catalogue: clearly there
_JITTER = 0.15  # log: strengths differ, so that a limit between levels can be fitted


@dataclass(frozen=True)
class Trial:
    """One arm to be built, recorded and traced."""

    id: str
    kind: str
    """clean, known, pair or outside"""
    effects: tuple[tuple[str, float], ...] = ()
    """Names, and strengths in typical strengths"""

    @property
    def name(self) -> str:
        """What is wrong with the arm."""
        return " + ".join(name for name, _ in self.effects) or "none"

    def rng(self, seed: int) -> np.random.Generator:
        """The trial's own randomness, whatever else is run."""
        return np.random.default_rng([seed, zlib.crc32(self.id.encode())])


def plan(known: Sequence[str], outside: Sequence[str], rounds: int, seed: int) -> list[Trial]:
    """All trials in the order in which they are to be run."""
    pairs = [(a, b) for n, a in enumerate(known) for b in known[n + 1 :]]
    np.random.default_rng(seed).shuffle(pairs)
    trials: list[Trial] = []
    for r in range(rounds):
        level, at = LEVELS[r % len(LEVELS)], f"{r:02d}"
        clean = [Trial(f"clean-{at}-{n}", CLEAN) for n in range(CLEAN_A_ROUND)]
        pair = [(name, 1.0) for name in pairs[r % len(pairs)]] if pairs else []
        both = [Trial(f"{'+'.join(n for n, _ in pair)}-{at}", PAIR, tuple(pair))] if pair else []
        single = [Trial(f"{name}-{at}", KNOWN, ((name, level),)) for name in known]
        other = [Trial(f"{n}-{at}", OUTSIDE, ((n, _OTHERS_LEVEL),)) for n in outside]
        trials += [*clean, *_turned(single, r), *_turned(other, r), *both]
    return [_jittered(trial, seed) for trial in trials]


def _turned(trials: list[Trial], by: int) -> list[Trial]:
    """Begin elsewhere in every round: what comes last is the first to fall to a budget."""
    by = by % len(trials) if trials else 0
    return trials[by:] + trials[:by]


def _jittered(trial: Trial, seed: int) -> Trial:
    rng = np.random.default_rng([seed, 1, zlib.crc32(trial.id.encode())])
    effects = tuple(
        (n, float(level * np.exp(rng.uniform(-_JITTER, _JITTER)))) for n, level in trial.effects
    )
    return Trial(trial.id, trial.kind, effects)


def chosen(trials: Sequence[Trial], only: Sequence[str], most: int) -> list[Trial]:
    """The first `most` trials (0: all) of those that have an effect in `only`, or are one of its kinds;
    with nothing in `only`, of all.
    """
    wanted = [
        t for t in trials if not only or t.kind in only or any(n in only for n, _ in t.effects)
    ]
    return wanted[: most or None]
