"""Let the effects of runs side by side act on a time step, in their order."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import Effect, ranges
from serpent_twin.errors import SerpentError

E = TypeVar("E", bound=Effect)


def stacked(several: Sequence[Sequence[Effect]]) -> list[Effect]:
    """The acting effects of n runs, each kind as one of n rows, in the order in which they act."""
    rows, kinds = [], {(type(effect), effect.at) for each in several for effect in each}
    for kind, at in sorted(kinds, key=lambda each: (each[0].stage, each[0].__name__, each[1])):
        if kind.acts():
            of = [
                next((e for e in each if (type(e), e.at) == (kind, at)), None) for each in several
            ]
            rows.append(stack([e or kind(at=at) for e in of]))
    return rows


def longest_step(effects: Sequence[Effect], moment: Any, runs: int) -> Array:
    """Longest time step that all memories of each run follow [s], (runs,); inf where none remembers."""
    longest = np.full(runs, np.inf)
    for effect in effects:
        own = np.broadcast_to(np.atleast_2d(effect.longest_step(moment)).min(axis=1), runs)
        longest = np.minimum(longest, own)
    return longest


def begin(effects: Sequence[Effect], moment: Any) -> list[Any]:
    """The memories of effects at the beginning of runs."""
    return [_alone(effect.start, effect, effect.here(moment)) for effect in effects]


def act(effects: Sequence[Effect], moment: Any, memories: Sequence[Any]) -> None:
    """Let effects change one time step, one after the other; raises a `SerpentError` that names an effect
    which reads what the moment lacks, or changes what the simulation does not use.
    """
    for effect, memory in zip(effects, memories, strict=True):
        _alone(effect.act, effect, effect.here(moment), memory)


def _alone(do: Callable[..., Any], effect: Effect, moment: Any, *memory: Any) -> Any:
    try:
        return do(moment, *memory)
    except (SerpentError, AttributeError, ValueError) as error:
        if not (why := _refused(error, moment)):
            raise
        raise SerpentError(f"the effect {type(effect).__name__} cannot act here: {why}") from error


def _refused(error: Exception, moment: Any) -> str:
    """Why a moment refused an effect, or nothing if it did not."""
    if isinstance(error, SerpentError):
        return str(error)
    if isinstance(error, AttributeError) and error.obj is moment:
        return (
            f"it needs {error.name}, which this machine's moment lacks. Leave it out of this twin."
        )
    if "read-only" in str(error):
        return "it writes into an array that effects read and do not change. Let it change a copy."
    return ""


def stack(effects: Sequence[E]) -> E:
    """One effect for n runs: its fields are the given ones' as (n, 1) arrays."""
    columns: dict[str, Array] = {
        name: np.array([[getattr(effect, name)] for effect in effects])
        for name in ranges(type(effects[0]))
    }
    return replace(effects[0], **columns)
