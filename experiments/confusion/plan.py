"""Plan which arms the confusion experiment builds, and in which order.

Round by round, so that a run which ends early leaves a balanced table: every round has each effect
once at a strength that is drawn, clean arms, one pair that can be confused, and each effect outside the
catalogue.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

CLEAN, KNOWN, PAIR, OUTSIDE = "clean", "known", "pair", "outside"
STRONG = "strong"
"""One effect alone, far above what is noticed: of the kind `KNOWN`"""
CLEAN_A_ROUND = 2
SESSIONS = 4
"""Sessions of an arm by default"""
LEVELS = {KNOWN: (0.1, 2.5), STRONG: (1.5, 4.0), PAIR: (0.7, 2.0), OUTSIDE: (0.5, 2.5)}
"""Strengths of each kind, in typical strengths, drawn evenly in their logarithm: of one effect alone, from
far below to above what is noticed
"""


@dataclass(frozen=True)
class Trial:
    """One arm to be built, recorded and traced."""

    id: str
    kind: str
    """clean, known, pair or outside"""
    effects: tuple[tuple[str, float], ...] = ()
    """Names, and strengths in typical strengths"""
    sessions: int = SESSIONS
    """Sessions of the arm; the last one judges"""
    strong: bool = False
    """Whether its effect is drawn from `STRONG` levels"""

    @property
    def name(self) -> str:
        """What is wrong with the arm."""
        return " + ".join(name for name, _ in self.effects) or "none"

    @property
    def level(self) -> str:
        """What its strengths are drawn from, of `LEVELS`; its kind, or strong."""
        return STRONG if self.strong else self.kind

    def rng(self, seed: int) -> np.random.Generator:
        """The trial's own randomness, whatever else is run."""
        return np.random.default_rng([seed, zlib.crc32(self.id.encode())])


def plan(
    known: Sequence[str],
    outside: Sequence[str],
    pairs: Sequence[tuple[str, str]],
    rounds: int,
    seed: int,
    sessions: Sequence[int] = (SESSIONS,),
) -> list[Trial]:
    """All trials in the order in which they are to be run. Numbers of sessions go through a round in turn,
    and each effect through the numbers from round to round.
    """
    pairs = list(pairs)
    np.random.default_rng(seed).shuffle(pairs)
    trials: list[Trial] = []
    for r in range(rounds):
        at = f"{r:02d}"
        clean = [Trial(f"clean-{at}-{n}", CLEAN) for n in range(CLEAN_A_ROUND)]
        single = [Trial(f"{name}-{at}", KNOWN, ((name, 1.0),)) for name in known]
        strong = [replace(each, id=f"{each.id}-{STRONG}", strong=True) for each in single]
        other = [Trial(f"{name}-{at}", OUTSIDE, ((name, 1.0),)) for name in outside]
        both = pairs[r % len(pairs)] if pairs else ()
        pair = [Trial(f"{'+'.join(both)}-{at}", PAIR, tuple((n, 1.0) for n in both))] * bool(both)
        every = [
            replace(trial, sessions=sessions[(r + n) % len(sessions)])
            for several in (clean, single, strong, other, pair)
            for n, trial in enumerate(several)
        ]
        by = {
            level: [each for each in every if each.level == level]
            for level in (CLEAN, KNOWN, OUTSIDE, PAIR, STRONG)
        }
        trials += [*by[CLEAN], *_turned(by[KNOWN], r), *_turned(by[OUTSIDE], r), *by[PAIR]]
        trials += _turned(by[STRONG], r)
    return [_drawn(trial, seed) for trial in trials]


def confusable(known: Sequence[str], alike: Mapping[str, Sequence[str]]) -> list[tuple[str, str]]:
    """Pairs of effects that can be taken for each other."""
    return [
        (a, b)
        for n, a in enumerate(known)
        for b in known[n + 1 :]
        if a in alike.get(b, ()) or b in alike.get(a, ())
    ]


def _turned(trials: list[Trial], by: int) -> list[Trial]:
    """Begin elsewhere in every round: what comes last is the first to fall to a budget."""
    by = by % len(trials) if trials else 0
    return trials[by:] + trials[:by]


def _drawn(trial: Trial, seed: int) -> Trial:
    rng = np.random.default_rng([seed, 1, zlib.crc32(trial.id.encode())])
    effects = tuple(
        (name, float(np.exp(rng.uniform(*np.log(LEVELS[trial.level])))))
        for name, _ in trial.effects
    )
    return replace(trial, effects=effects)


def chosen(trials: Sequence[Trial], only: Sequence[str], most: int) -> list[Trial]:
    """The first `most` trials (0: all) of those that have an effect in `only`, or are one of its kinds;
    with nothing in `only`, of all. Strong ones must be asked for.
    """

    def wanted(trial: Trial) -> bool:
        if trial.strong != (STRONG in only):
            return False
        words = [each for each in only if each != STRONG]
        return not words or trial.kind in words or any(n in words for n, _ in trial.effects)

    return [each for each in trials if wanted(each)][: most or None]
