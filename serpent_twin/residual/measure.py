"""Name a measured quantity, and the unit in which its error is reported."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Measure:
    """A quantity that is measured and predicted."""

    one: str
    """Its name, such as `marker`"""
    are: str
    """Its name as the subject of a sentence, such as `the markers are`"""
    size: str
    """Name of its error, such as `mean marker distance`"""
    unit: str
    """Unit in which people read it"""
    key: str
    """The unit as a JSON key ends with it"""
    scale: float
    """How many of these units are one unit of the arrays"""
    base: str
    """The arrays' unit"""
    noise: str = "noise of the measurement alone"
    """What makes the error of a twin that lacks nothing"""
    axes: str = ""
    """Letters of its coordinates; nothing where there is one"""
    order: str = ""
    """Words for the order in which several are listed"""
    zero: str = "the sensors' zeros and the model's keyframe"
    """Where to look if it is off by a constant"""
    view: str = ""
    """What else may be in the way of its measurement"""
    shaken: str = " or its frame"
    """What may shake besides the machine"""
    across: str = "Where"
    """Caption of what is drawn by place"""

    @property
    def field(self) -> str:
        """Its name in a JSON key."""
        return self.one.replace(" ", "_")

    @property
    def dimension(self) -> int:
        """How many coordinates it has."""
        return len(self.axes) or 1

    @property
    def along(self) -> tuple[str, ...]:
        """The suffix of each coordinate's name."""
        return tuple(f" along {axis}" for axis in self.axes) or ("",)

    @property
    def error(self) -> str:
        """Its error in a sentence."""
        return f"{self.what}' error" if self.axes else f"the {self.one} error"

    @property
    def apart(self) -> str:
        """What measured and predicted are apart."""
        return "distance" if self.axes else f"{self.one} error"

    @property
    def what(self) -> str:
        """Its name in a sentence, such as `the markers`."""
        return self.are.rsplit(" ", 1)[0]


MARKERS = Measure(
    "marker",
    "the markers are",
    "mean marker distance",
    "mm",
    "mm",
    1e3,
    "m",
    "noise of the cameras alone",
    "xyz",
    ", from the base to the tip",
    "where markers sit and how the frame was aligned",
    ", the cameras' view",
    ", its frame or the cameras",
    "Where along the machine",
)
POSITION = Measure(
    "position", "the positions are", "mean distance", "mm", "mm", 1e3, "m", axes="xyz"
)
LOADS = Measure(
    "load",
    "the loads are",
    "load error, rms",
    "% of stall",
    "percent",
    100.0,
    "of stall",
    "noise of the loads alone",
)
ANGLE = Measure("angle", "the angle is", "mean error of the angle", "°", "deg", 180 / np.pi, "rad")
LENGTH = Measure("length", "the length is", "mean error of the length", "mm", "mm", 1e3, "m")
ANGULAR_VELOCITY = Measure(
    "angular velocity",
    "the angular velocity is",
    "angular velocity error, rms",
    "°/s",
    "deg_per_s",
    180 / np.pi,
    "rad/s",
)
VELOCITY = Measure(
    "velocity", "the velocity is", "velocity error, rms", "mm/s", "mm_per_s", 1e3, "m/s"
)
ACCELERATION = Measure(
    "acceleration",
    "the acceleration is",
    "acceleration error, rms",
    "m/s²",
    "m_per_s2",
    1.0,
    "m/s²",
)
MAGNETIC_FIELD = Measure(
    "magnetic field",
    "the magnetic field is",
    "magnetic field error, rms",
    "µT",
    "uT",
    1e6,
    "T",
)
READING = Measure("reading", "the reading is", "reading error, rms", "1", "1", 1.0, "1")
FORCE = Measure("force", "the force is", "force error, rms", "N", "n", 1.0, "N")
CONTROL = Measure("control", "the control is", "mean error of the control", "1", "1", 1.0, "1")
TORQUE = Measure("torque", "the torque is", "torque error, rms", "mN m", "mNm", 1e3, "N m")
MEASURES = {
    each.base: each
    for each in (
        *(LENGTH, ANGLE, FORCE, TORQUE, VELOCITY, ANGULAR_VELOCITY),
        *(ACCELERATION, MAGNETIC_FIELD, READING),
    )
}
"""Quantities of one number that a model may be compared with, by SI unit"""
