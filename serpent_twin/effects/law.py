"""Compose a law: what it changes at a place of the model, and how that follows a reading."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import listed

_TEXT = re.compile(r"(\w+) of (.+?): (\w+)(?: (\w+) of (.+))?")


@dataclass(frozen=True)
class LawQuantity:
    """What a law may follow or change at places of one kind."""

    kind: str
    """Kind of place: joint, actuator, tendon, body, sensor or frame; for a clock, session or machine"""
    unit: str
    components: int = 1
    """1, 3 for a vector, or 4 for a spring: the force at the base's origin [N], and the stiffness [N/m]"""
    only_more: bool = False
    """Whether it, or the stiffness of a spring, may be raised only, as friction"""
    words: str = ""
    """What is changed, with {size} and {place}; empty where laws only follow it"""
    only_seen: bool = False
    """Whether it is what the arm's sensors show beside its motion"""
    followed: bool = False
    """Whether laws may follow it"""
    rate: str = ""
    """The quantity that is its rate, if laws may follow that, too"""

    def told(self, place: str, size: str = "") -> str:
        """What is changed at a place, by a size in words."""
        return self.words.format(place=place, size=f" of {size}" if size else "")


SPRING = "spring"
"""A force on a body that pulls it to a point of the base's frame, growing with the distance"""
FORCES = ("force", "force_in_body", SPRING)
"""What pulls at a body"""
READING_SHIFT = "reading_shift"
"""The one quantity that is changed after all time steps of a run"""
ACTUATOR_COMMAND = "command"
"""The command of an actuator: laws may follow it, and may change it before the time steps"""
JOINT_FRICTION = "joint_friction"
"""Dry friction of a joint"""
POSITIONS = ("position_x", "position_y", "position_z")
"""Readings along axes of the base frame, of a model the world's"""
_OF_JOINTS = ("joint_angle", "joint_velocity")
CLOCKS = ("session", "machine")
"""Kinds of what time is of"""
QUANTITIES: Mapping[str, LawQuantity] = {
    "joint_torque": LawQuantity("joint", "N m", words="a torque{size} at {place}"),
    JOINT_FRICTION: LawQuantity("joint", "N m", only_more=True, words="friction{size} at {place}"),
    "gear_friction": LawQuantity(
        "actuator", "N m", only_more=True, words="gear friction{size} at {place}"
    ),
    "motor_torque": LawQuantity("actuator", "N m", words="a torque{size} on the horn of {place}"),
    "winch_angle": LawQuantity(
        "actuator",
        "rad",
        words="a turn{size} of the winch of {place} that its encoder does not show",
    ),
    ACTUATOR_COMMAND: LawQuantity(
        "actuator",
        "1",
        words="a change{size} of the command that reaches {place}",
        followed=True,
    ),
    "slack": LawQuantity("tendon", "m", words="a length{size} that {place} has more"),
    "force": LawQuantity("body", "N", 3, words="a force{size} in the base frame on {place}"),
    "force_in_body": LawQuantity(
        "body", "N", 3, words="a force{size} in the frame of {place} on it"
    ),
    SPRING: LawQuantity(
        "body", "N", 4, only_more=True, words="a spring{size} that pulls {place} to a point"
    ),
    "link_turn": LawQuantity(
        "body",
        "rad",
        3,
        words="a turn{size} of {place} and all beyond, in its frame",
        only_seen=True,
    ),
    "marker_shift": LawQuantity(
        "sensor", "m", 3, words="a shift{size} of {place} in its link's frame", only_seen=True
    ),
    "load_shift": LawQuantity(
        "sensor", "1", words="a change{size} of what {place} reads", only_seen=True
    ),
    "load_scale": LawQuantity(
        "sensor", "1", words="a change of what {place} reads by a share{size} of it", only_seen=True
    ),
    READING_SHIFT: LawQuantity("sensor", "rad", words="a shift{size} of what is read of {place}"),
    "camera_shift": LawQuantity(
        "frame", "m", 3, words="a shift{size} of all that the cameras see", only_seen=True
    ),
    "camera_turn": LawQuantity(
        "frame", "rad", 3, words="a turn{size} of all that the cameras see", only_seen=True
    ),
    "camera_delay": LawQuantity(
        "frame", "s", words="a delay{size} of all that the cameras see", only_seen=True
    ),
    "acceleration": LawQuantity("frame", "m/s²", 3, words="an acceleration{size} of the {place}"),
    "joint_angle": LawQuantity("joint", "rad", followed=True, rate="joint_velocity"),
    "joint_velocity": LawQuantity("joint", "rad/s", followed=True),
    "motor_angle": LawQuantity("actuator", "rad", followed=True, rate="motor_velocity"),
    "motor_velocity": LawQuantity("actuator", "rad/s", followed=True),
    "horn_torque": LawQuantity("actuator", "N m", followed=True),
    "tension": LawQuantity("tendon", "N", followed=True),
    **dict.fromkeys(POSITIONS, LawQuantity("body", "m", followed=True)),
    "time": LawQuantity("session", "s", followed=True),
    "runtime": LawQuantity("machine", "s", followed=True),
}
"""Quantities that laws change or follow, by name, which is that of the moment's quantity"""
HANDLES = {name: each for name, each in QUANTITIES.items() if each.words}
"""What laws change"""
READINGS = {name: each for name, each in QUANTITIES.items() if each.followed}
"""What laws may follow"""


@dataclass(frozen=True)
class Law:
    """A law at a place, without its numbers."""

    handle: str
    """What it changes, of `HANDLES`"""
    place: str
    """Where, by MuJoCo's name"""
    shape: str = "constant"
    """How, of `SHAPES`"""
    reading: str = ""
    """Reading that it follows, of `READINGS`; empty for a constant"""
    where: str = ""
    """Place of the reading that it follows; empty for a constant"""

    def __str__(self) -> str:
        follows = f" {self.reading} of {self.where}" if self.reading else ""
        return f"{self.handle} of {self.place}: {self.shape}{follows}"

    @property
    def possible(self) -> bool:
        """Whether what it changes may follow its reading: commands, which are changed before anything moves,
        follow commands, and nothing else does; readings, which are changed after that, follow joints. What
        drags something along is a reading of the thing that is changed.
        """
        if drags := SHAPES[self.shape].drags:
            own = self.of_itself or self.place == self.where
            either_way = not HANDLES[self.handle].only_more
            in_time_steps = self.handle not in (READING_SHIFT, ACTUATOR_COMMAND)
            return own and either_way and in_time_steps and self.reading in drags.readings
        if self.handle == READING_SHIFT and self.follows_a_thing:
            return self.reading in _OF_JOINTS
        alike = (self.reading == ACTUATOR_COMMAND) == (self.handle == ACTUATOR_COMMAND)
        return alike or not self.follows_a_thing

    @property
    def follows_a_thing(self) -> bool:
        """Whether it follows a reading of a part of the machine: neither a clock nor nothing."""
        return bool(self.reading) and READINGS[self.reading].kind not in CLOCKS

    @property
    def rate(self) -> "Law | None":
        """Law with the rate of this law's reading as its own, if that is a reading, too; else None."""
        rate = READINGS[self.reading].rate if self.reading else ""
        return replace(self, reading=rate) if rate else None

    @property
    def of_itself(self) -> bool:
        """Whether it follows a reading of the thing that it changes: of the joint, the motor or its cable."""
        digits = re.compile(r"[a-z]+(\d+)")
        place, where = digits.match(self.place), digits.match(self.where)
        if not place or not where or place[1] != where[1]:
            return False
        kinds = HANDLES[self.handle].kind, READINGS[self.reading].kind
        return kinds[0] == kinds[1] or {*kinds} <= {"actuator", "tendon", "sensor"}

    @property
    def depends_on(self) -> str:
        """What it follows, in words; nothing for a constant."""
        if not self.reading:
            return ""
        of = f" of {self.where}" if self.follows_a_thing else ""
        return f"{self.reading.replace('_', ' ')}{of}"

    def clock(self, time: Array, prior_runtime: Array | float) -> Array | None:
        """What it follows at times since a session began, if that is no thing: one of the clocks, or zeros of
        a constant; else None.
        """
        if not self.reading:
            return np.zeros_like(time)
        clocks = {"time": time, "runtime": time + prior_runtime}
        return clocks.get(self.reading)

    def units(self, size: str = "", of: str = "") -> dict[str, str]:
        """The units of size, and of the parameters of its shape, where what is changed or what it follows
        has another unit than `HANDLES` and `READINGS` state.
        """
        of = of or (READINGS[self.reading].unit if self.reading else "1")
        size = size or HANDLES[self.handle].unit
        if self.shape in ("linear", "beyond", "below", "play", "lag"):
            size = f"{size} per {of}"
        special = {"periodic": (f"rad per {of}", "rad"), "lag": ("s", of)}
        first, second = special.get(self.shape, (of, of))
        return {"size": size, "first": first, "second": second, "bound": of}


@lru_cache(maxsize=4096)
def parse(text: str) -> Law:
    """The law that a text states, as `str` writes it; raises a `SerpentError` that says what there is."""
    found = _TEXT.fullmatch(text)
    if not found:
        raise SerpentError(
            f"{text!r} states no law, such as 'joint_torque of joint5: above joint_angle of joint5'."
        )
    handle, place, shape, reading, where = found.groups(default="")
    for name, known, what in (
        (handle, HANDLES, "quantity that a law changes"),
        (shape, SHAPES, "law"),
        *([(reading, READINGS, "reading that a law follows")] if reading else []),
    ):
        if name not in known:
            raise SerpentError(f"there is no {what} named {name!r}; there are: {listed(known)}.")
    return Law(handle, place, shape, reading, where)
