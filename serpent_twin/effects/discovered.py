"""Add a law at a place that no other effect describes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import LOSS, READING, WINDING, Effect, parameter
from serpent_twin.effects.law import (
    ACTUATOR_COMMAND,
    HANDLES,
    JOINT_FRICTION,
    READING_SHIFT,
    SPRING,
    Law,
    parse,
)
from serpent_twin.effects.law_shape import SHAPES, LawShape
from serpent_twin.effects.links import let_hold

DISCOVERED = "discovered"
"""The name of an effect that a trace composed"""
_ANY = 1e9


@dataclass(frozen=True)
class Discovered(Effect):
    """A change at a place of the model that follows a reading, by the law that its place states.

    The change is size · f(x; first, second), with f one of `law.SHAPES`; a vector has three sizes, a spring a
    stiffness besides. Beyond the readings of the logs in which it was found, it stays as it is at their ends.
    Source: those logs.
    """

    size: float = parameter("1", low=-_ANY, high=_ANY, typical=1.0)
    """Size of the change, in its unit or in that per unit of the reading; of a vector, its x"""
    size_y: float = parameter("1", low=-_ANY, high=_ANY, typical=1.0)
    """Size of the change along a vector's y"""
    size_z: float = parameter("1", low=-_ANY, high=_ANY, typical=1.0)
    """Size of the change along a vector's z"""
    stiffness: float = parameter("1", low=-_ANY, high=_ANY, typical=1.0, before=0.0)
    """Stiffness of a spring [N/m]; its vector is the force where its body is at the base's origin"""
    first: float = parameter("1", low=-_ANY, high=_ANY, typical=0.0, fitted=False)
    """First parameter of the law"""
    second: float = parameter("1", low=-_ANY, high=_ANY, typical=0.0, fitted=False)
    """Second parameter of the law"""
    least: float = parameter("1", low=-_ANY, high=_ANY, typical=0.0, fitted=False)
    """Least reading in the logs; a law without bounds has both bounds zero"""
    most: float = parameter("1", low=-_ANY, high=_ANY, typical=0.0, fitted=False)
    """Most"""

    shows_in = "what no named effect explains"
    stage = LOSS
    remembers = False  # a guess does where nothing is known of the past

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.at:
            parse(self.at)

    @property
    def law(self) -> Law:
        """The law that it follows."""
        return parse(self.at)

    @property
    def shape(self) -> LawShape:
        """How it follows its reading."""
        return SHAPES[self.law.shape]

    @property
    def strength(self) -> float:
        """The length of the vector of sizes; of a spring, its stiffness."""
        if self.at and self.law.handle == SPRING:
            return abs(self.stiffness)
        return float(np.linalg.norm([self.size, self.size_y, self.size_z]))

    @property
    def only_seen(self) -> bool:
        """Whether its law changes what sensors show, and remembers nothing."""
        return HANDLES[self.law.handle].only_seen and not self.shape.drags

    @property
    def acts_at(self) -> int:
        """Stage at which it acts, by what its law changes."""
        return {READING_SHIFT: READING, ACTUATOR_COMMAND: WINDING}.get(self.law.handle, self.stage)

    @property
    def things(self) -> frozenset[str]:
        """What it changes, and what it follows; a clock is no thing."""
        law = self.law
        return frozenset({law.place, law.where} if law.follows_a_thing else {law.place})

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Let friction hold a joint that has none in the model."""
        law = self.law
        if law.handle == JOINT_FRICTION and not spec.joint(law.place).frictionloss:
            let_hold(spec, law.place)

    def here(self, moment: Any) -> Any:
        """The whole moment: the law says where."""
        return moment

    def start(self, moment: Any) -> Array | None:
        """Where that is which the reading drags along; None where it drags nothing."""
        if not self.shape.drags:
            return None
        x, rate = moment.reading_of(self.law), self.law.rate
        moves = np.zeros_like(x) if rate is None else moment.reading_of(rate)
        return self.shape.drags.begins(x, moves, self.first)

    @property
    def recalls(self) -> bool:
        """Whether it forgets slowly."""
        return bool(self.at and self.shape.drags and self.shape.drags.lasting)

    def act(self, moment: Any, memory: Array | None) -> None:
        """Change what the law changes."""
        x = moment.reading_of(self.law)
        bounded = np.asarray(self.most) > np.asarray(self.least)
        x = np.where(bounded, np.clip(x, self.least, np.maximum(self.least, self.most)), x)
        if self.shape.drags and memory is not None:
            memory[...] = self.shape.drags.after(memory, x, self.first, moment.dt)
            x = memory - x
        change = self.shape.form(x, self.first, self.second)
        sizes: Sequence[Array | float] = (self.size, self.size_y, self.size_z, self.stiffness)
        sizes = sizes[: HANDLES[self.law.handle].components]
        moment.change(self.law, [size * change for size in sizes])
