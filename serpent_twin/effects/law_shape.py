"""Say how a change may follow a reading."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.play import behind

_EDGE = 1e-3
"""Half width of a threshold, in the unit of its reading: where a law sets in, it does so within that"""

Form = Callable[[Array, Array | float, Array | float], Array]


@dataclass(frozen=True)
class LawShape:
    """How a change follows a reading x, by up to two parameters."""

    form: Form
    """f(x, first, second); 1 where the change has its full size"""
    parameters: tuple[str, ...] = ()
    """Names of the parameters"""
    words: str = ""
    """With {x} for the reading, {first} and {second}"""
    plain: str = ""
    """The same without numbers, where the words have some"""
    drags: bool = False
    """Whether it follows not a reading but by how much what the reading drags along through a play of width
    `first` is behind: it remembers
    """

    def followed(self, x: Array, first: float, second: float) -> Array:
        """The change in rows of runs in which a reading was x, (…, T)."""
        return self.form(behind(x, first) if self.drags else x, first, second)


def _above(x: Array, first: Array | float, second: Array | float) -> Array:
    return np.clip((x - first) / (2 * _EDGE) + 0.5, 0.0, 1.0)


def _within(x: Array, first: Array | float, second: Array | float) -> Array:
    return _above(x, first, 0.0) - _above(x, first + np.abs(second), 0.0)


SHAPES: Mapping[str, LawShape] = {
    "constant": LawShape(lambda x, a, b: np.ones_like(x), (), "always"),
    "linear": LawShape(lambda x, a, b: x, (), "in proportion to {x}"),
    "beyond": LawShape(
        lambda x, a, b: np.maximum(x - a, 0.0),
        ("threshold",),
        "growing with {x} beyond {first}",
        "growing with {x} beyond a threshold",
    ),
    "below": LawShape(
        lambda x, a, b: np.minimum(x - a, 0.0),
        ("threshold",),
        "growing with {x} below {first}",
        "growing with {x} below a threshold",
    ),
    "above": LawShape(
        _above, ("threshold",), "while {x} is above {first}", "while {x} is above a threshold"
    ),
    "under": LawShape(
        lambda x, a, b: 1.0 - _above(x, a, b),
        ("threshold",),
        "while {x} is below {first}",
        "while {x} is below a threshold",
    ),
    "within": LawShape(
        _within,
        ("from", "width"),
        "while {x} is in a window that begins at {first} and is {second} wide",
        "while {x} is in a window",
    ),
    "play": LawShape(
        lambda x, a, b: x,
        ("gap",),
        "as {x} takes up a play of {first} after each reversal",
        "as {x} takes up a play after each reversal",
        drags=True,
    ),
    "periodic": LawShape(
        lambda x, a, b: np.sin(a * x + b),
        ("rate", "phase"),
        "as a sine of {x}, at {first}",
        "as a sine of {x}",
    ),
}
"""How changes follow readings, by name"""
