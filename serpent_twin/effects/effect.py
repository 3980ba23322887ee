"""Define what an effect is, and the ranges of its parameters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from math import isfinite
from typing import Any, ClassVar

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law_shape import FORMS
from serpent_twin.effects.links import add_to, let_hold
from serpent_twin.errors import SerpentError


@dataclass(frozen=True)
class Range:
    """Where a parameter may lie, in its unit."""

    unit: str
    low: float
    high: float
    typical: float
    """A plausible value in an arm of this size: where a fit starts, and how far its first step goes"""
    fitted: bool = True
    """Whether logs identify it; else it is given, or tried at the few values of `variants`"""
    step: float = 0.0
    """Finite difference; 0: a fifth of its value or of its typical value"""
    before: float | None = None
    """What holds in files that were written before it was a parameter; None: every file has it"""
    within: Callable[[float], tuple[float, ...]] | None = None
    """Places within a place, such as the cables of an arm, for a parameter that is one"""
    adds_to: str = ""
    """The field of MJCF that it adds to where its effect is, such as `joint.stiffness.2`"""
    limit: str = ""
    """The law that its high end is, in words; nothing: an effect that runs there stands for another"""
    form: bool = False
    """Whether it sets the form of a law and is no strength, whatever its unit"""
    strength: bool = False
    """Whether it is a strength, whatever its unit"""

    @property
    def least(self) -> float:
        """Its lowest value while fitted: just above a low of zero, where the effect would leave the model."""
        return 1e-6 * self.typical if self.fitted and self.low == 0 else self.low

    @property
    def anywhere(self) -> "Range":
        """Range for a machine of any size: of the same sign, and finite."""
        low = -_ANY if self.low < 0 else min(self.low, 1 / _ANY)
        return replace(self, low=low, high=_ANY)

    @property
    def unused(self) -> bool:
        """Whether it can only be zero, as the second component of what has one."""
        return not self.fitted and self.low == self.high == 0

    @property
    def limit_begins(self) -> float:
        """Value from which on the law of the high end holds; infinite without such a law."""
        return _NEARLY * self.high if self.limit and self.fitted else float("inf")


_ANY = 1e9
_NEARLY = 0.3
"""Share of a range from which on a value is the law of its high end: it is many thousand times the typical
one there, and nothing shows any more how large it is"""
SMOOTH = 0.2
"""Share of a time constant that one explicit time step may take: what relaxes does so without overshoot, and
is never off by more than 5 %."""
_UNKNOWN = 0.005  # [s] as the simulation's own
COMMAND, SERVO, WINDING, CABLE, LOSS, READING = range(6)
"""Order in a time step: goals of the servos, their angles, winding and properties of the cables, friction by
their tension; and of what is read, after all time steps."""


def parameter(
    unit: str,
    high: float,
    typical: float,
    low: float = 0.0,
    default: float = 0.0,
    **more: Any,
) -> Any:
    """A field of an effect, within low … high, in a unit; where the effect's strengths are 0 it must be
    absent. `more` are the other fields of its `Range`.
    """
    return field(default=default, metadata={"range": Range(unit, low, high, typical, **more)})


@dataclass(frozen=True)
class Effect:
    """Physics that the nominal twin leaves out. All fields zero, or `absent`, is the nominal twin.

    `edit` writes what MJCF can express into the machine's spec; `act` changes one time step of many runs
    at once, with what `start` returned as memory. What `act` reads of its moment determines which machines
    can have it. A stacked effect (`stack`) has (n, 1) arrays for fields: `start` and
    `act` are written so that both work. `edit` is given numbers only.
    """

    at: str = field(default="", kw_only=True)
    """Name of the joint, actuator or body of a model where it is; empty: all that it is about"""

    places: ClassVar[tuple[str, ...]] = ()
    """Kinds of a model's elements that `at` may name, in the order in which they are looked up."""
    shows_in: ClassVar[str] = ""
    """How it shows in a log, in words."""
    confused_with: ClassVar[tuple[str, ...]] = ()
    """Names of effects that look like it."""
    remembers: ClassVar[bool] = False
    """Whether its memory outlasts a segment, so that sessions are run through; to be said of a memory."""
    model_error: ClassVar[float] = 0.01
    """Relative standard error of its parameters for what its law simplifies (type B: JCGM 100, 4.3);
    independent arms were off by as much."""
    stage: ClassVar[int] = CABLE
    """When in a time step it acts."""
    law: ClassVar[str] = ""
    """What of the moment its first parameter adds to, times a form of a reading that may have the second, as
    `joint_friction: near_rest joint_velocity`: such an effect has no `act` of its own."""
    needs: ClassVar[frozenset[str]] = frozenset()
    """Names of quantities of the moment that it acts on and not every machine has."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "start" in vars(cls) and "remembers" not in vars(cls):
            raise SerpentError(
                f"{cls.__name__} has a memory, which `start` makes, but does not say how long it lasts. Add "
                "`remembers: ClassVar[bool] = True` if it outlives a segment of 40 s, so that sessions are "
                "run through from their first row; or False if every segment may begin with a fresh one."
            )

    def __post_init__(self) -> None:
        for name, known in ranges(type(self)).items():
            value, allowed = getattr(self, name), known.anywhere if self.at else known
            if isinstance(value, np.ndarray):
                continue
            if not (isfinite(value) and allowed.low <= value <= allowed.high):
                raise SerpentError(
                    f"{type(self).__name__}: {name} is {value:g} {allowed.unit}; it must lie within "
                    f"{allowed.low:g} … {allowed.high:g} {allowed.unit}."
                )

    @property
    def strength(self) -> float:
        """The length of the vector of its strengths, in the unit of its first parameter; zero is absence."""
        several = [getattr(self, name) for name in strengths(ranges(type(self)))]
        return float(np.linalg.norm(several))

    @property
    def absent(self) -> bool:
        """Whether it changes nothing at all."""
        return self.strength == 0

    @property
    def of_readings(self) -> bool:
        """Whether it changes what is read of a run, after all time steps."""
        return self.acts_at == READING

    @property
    def only_seen(self) -> bool:
        """Whether it changes nothing but what sensors show, and remembers nothing."""
        return False

    @property
    def sites_later(self) -> float:
        """Time by which what sites show in a row is later than what drives the machine there [s]."""
        return 0.0

    @property
    def acts_at(self) -> int:
        """The stage at which it acts: that of its kind, unless what it changes is stated by its place."""
        return self.stage

    @property
    def things(self) -> frozenset[str]:
        """Names of the model's things that it reads or changes; one is empty if it may be all of a kind."""
        return frozenset({self.at})

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Write into the machine's spec what MJCF can express of it; friction at a joint lets that stick."""
        for name, known in ranges(type(self)).items():
            if known.adds_to:
                add_to(spec, known.adds_to, self.at, getattr(self, name))
        if self.at and self.law.startswith(("gear_friction", "joint_friction")):
            let_hold(spec, self.at)

    def export(self, spec: mujoco.MjSpec) -> bool:
        """Write into a spec to be given away what MJCF can express of `act`; whether it is all."""
        return not self.acts()

    def start(self, moment: Any) -> Any:
        """Its memory at the beginning of a run."""

    def act(self, moment: Any, memory: Any) -> None:
        """Change one time step of n runs, and the memory, in place."""
        if self.law:
            quantity, form, reading = _parts(self.law)
            size, *others = (getattr(self, name) for name in ranges(type(self)))
            change = size * FORMS[form](getattr(moment, reading), *others)
            setattr(moment, quantity, getattr(moment, quantity) + change)

    def here(self, moment: Any) -> Any:
        """The moment as it is where the effect acts."""
        return moment.at(self.at)

    @property
    def recalls(self) -> bool:
        """Whether what was measured before a short segment is to be gone through for its memory."""
        return self.remembers

    def longest_step(self, moment: Any) -> Array | float:
        """Longest time step of its memory in a measured past [s]: `SMOOTH` of its law's time constant,
        where that is known.
        """
        return _UNKNOWN if self.remembers else np.inf

    @classmethod
    def variants(cls) -> "Several":
        """Typical instances in an arm of this size, from which fits start; more than one if a parameter
        that is not fitted sets its place or form.
        """
        typical: dict[str, Any] = {n: r.typical for n, r in ranges(cls).items()}
        return (cls(**typical),)

    @classmethod
    def acts(cls) -> bool:
        """Whether it does more than `edit` expresses, so that Python runs in every time step."""
        return bool(cls.law) or cls.act is not Effect.act


Several = tuple[Effect, ...]
"""Effects, at most one of each kind."""


@cache
def _parts(law: str) -> list[str]:
    """The quantity, the form and the reading of a law such as `gear_friction: near_rest joint_velocity`."""
    return law.replace(":", "").split()


@cache
def ranges(kind: type[Effect]) -> Mapping[str, Range]:
    """The parameters of a kind of effect, by name."""
    return {each.name: each.metadata["range"] for each in fields(kind) if each.metadata}


def strengths(known: Mapping[str, Range]) -> tuple[str, ...]:
    """Names of the parameters that are an effect's strength: the first, the fitted ones of its unit, and what
    says so.
    """
    first = next(iter(known))
    return tuple(
        n
        for n, r in known.items()
        if n == first or (r.fitted and not r.form and (r.strength or r.unit == known[first].unit))
    )


def edit(spec: mujoco.MjSpec, effects: Sequence[Effect]) -> None:
    """Write into a machine's spec what MJCF can express of the effects that are there, in their order."""
    for effect in sorted(effects, key=lambda effect: effect.stage):
        if not effect.absent:
            effect.edit(spec)
