"""Say how a change may follow a reading."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.lag import lagging, lagging_along, lagging_from_rest
from serpent_twin.effects.play import dragged, dragged_along, dragged_from_afar

_EDGE = 1e-3
"""Half width of a threshold, in the unit of its reading: where a law sets in, it does so within that"""

Form = Callable[[Array, Array | float, Array | float], Array]


@dataclass(frozen=True)
class Dragging:
    """How something follows a reading x and remembers where it was, by one parameter."""

    begins: Callable[[Array, Array, Array | float], Array]
    """Where it is at first, from x, the rate of x and the parameter"""
    after: Callable[[Array, Array, Array | float, Array | float], Array]
    """Where it is then, from where it was, x, the parameter and the time in between [s]"""
    along: Callable[[Array, Array, float, float], Array]
    """Values of what follows x in rows of runs, (…, T), from x in these, its value in the first, the
    parameter and the time between rows [s]
    """
    words: str
    """What is followed, with {x}"""
    readings: tuple[str, ...]
    """Names of the readings x that may be followed"""
    lasting: bool = False
    """Whether it remembers so long that what was before a short segment counts"""

    def behind(self, x: Array, first: float, dt: float) -> Array:
        """Value of what follows x, minus x, in rows of runs, (…, T), dt [s] apart."""
        rate = (x[..., min(1, x.shape[-1] - 1)] - x[..., 0]) / dt
        return self.along(x, self.begins(x[..., 0], rate, first), first, dt) - x


@dataclass(frozen=True)
class LawShape:
    """How a change follows a reading x, by up to two parameters."""

    form: Form
    """f(x, first, second); 1 where the change has its full size"""
    parameters: tuple[str, ...] = ()
    """Names of the parameters"""
    words: str = ""
    """Description, with {x} for the reading, and {first} and {second} for the parameters"""
    plain: str = ""
    """Description without numbers, where `words` has some"""
    drags: Dragging | None = None
    """How what the reading drags along remembers, where the change follows by how much that is behind"""


def _above(x: Array, first: Array | float, second: Array | float) -> Array:
    return np.clip((x - first) / (2 * _EDGE) + 0.5, 0.0, 1.0)


def _within(x: Array, first: Array | float, second: Array | float) -> Array:
    return _above(x, first, 0.0) - _above(x, first + np.abs(second), 0.0)


_ANGLES = ("joint_angle", "motor_angle")

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
        drags=Dragging(
            dragged_from_afar,
            lambda at, x, gap, dt: dragged(at, x, gap),
            lambda x, begun, gap, dt: dragged_along(x, begun, gap),
            "by how much what {x} drags along is behind",
            _ANGLES,
        ),
    ),
    "lag": LawShape(
        lambda x, a, b: x,
        ("time_constant",),
        "against the recent change of {x}, which is forgotten with a time constant of {first}",
        "against the recent change of {x}",
        drags=Dragging(
            lagging_from_rest,
            lagging,
            lagging_along,
            "minus the recent change of {x}",
            (*_ANGLES, "horn_torque"),
            lasting=True,
        ),
    ),
    "periodic": LawShape(
        lambda x, a, b: np.sin(a * x + b),
        ("rate", "phase"),
        "as a sine of {x}, at {first}",
        "as a sine of {x}",
    ),
}
"""How changes follow readings, by name"""

FORMS: Mapping[str, Callable[..., Array]] = {
    "constant": lambda x: np.ones_like(x),
    "magnitude": lambda x: np.abs(x),
    "near_rest": lambda x, fast: np.exp(-np.abs(x) / fast),
    "fading": lambda x, time: np.exp(-np.maximum(x, 0.0) / time),
}
"""How named effects follow readings in other ways, by name"""
