"""Read what the name of a log's column says: command or reading, which quantity, unit and whose."""

import re
from dataclasses import dataclass

COMMAND, READING = "command", "reading"
"""What a column may be, by its name; nothing where it does not tell"""
POSITION, VELOCITY, EFFORT, OTHER = "position", "velocity", "effort", "other"
"""Which quantity it may be"""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_COMMANDS = _words(
    "cmd command commanded commands goal target desired des ctrl control con ref reference setpoint "
    "setpoints set sp action actions demand demanded requested request u"
)
_READINGS = _words(
    "meas measured measurement actual encoder enc state states fb feedback present observation obs "
    "real read reading sensor sensed current_position q theta"
)
_SURE = _words("meas measured actual present fb feedback observation")
_POSITIONS = _words(
    "pos position positions q qpos theta angle angles ang encoder enc th phi displacement"
)
_VELOCITIES = _words(
    "vel velocity velocities dq qd qvel rate speed omega dtheta thetad dot qdot thetadot"
)
_ACCELERATIONS = _words("acc accel acceleration ddq qdd ddot")
_EFFORTS = _words(
    "eff effort efforts tau torque torques current currents curr cur force forces load amp amps "
    "ampere iq trq pwm"
)
_CURRENTS = _words("current currents curr cur amp amps ampere iq")
_OTHERS = _words(
    "temp temperature volt volts voltage battery bat batt counter count cnt loop seq sequence index idx "
    "frame error err status flag enable enabled cpu episode id mode power energy fault humidity pressure "
    "label task done reward noise latency"
)
_TIMES = _words(
    "t time times timestamp timestamps stamp clock sec secs seconds nsec nanosec millis micros tick "
    "ticks datetime date ts elapsed"
)
_NOUNS = _words(
    "joint joints states state axis axes motor motors servo servos actuator actuators act robot arm "
    "data observation action js jnt drive"
)
_ROLES = _COMMANDS | _READINGS | _POSITIONS | _VELOCITIES | _ACCELERATIONS | _EFFORTS | _OTHERS
_QUANTITIES = (
    (OTHER, _OTHERS | _ACCELERATIONS),
    (VELOCITY, _VELOCITIES),
    (EFFORT, _EFFORTS),
    (POSITION, _POSITIONS),
)
"""What is beside the point, such as a temperature, first"""
_CALLED = {
    "deg": "deg degs degree degrees °",
    "rad": "rad rads radian radians",
    "mrad": "mrad",
    "turn": "turn turns rev",
    "mm": "mm",
    "cm": "cm",
    "m": "meter meters metre",
    "µm": "um µm",
    "N m": "nm",
    "mN m": "mnm",
    "ms": "ms msec millis",
    "µs": "us µs usec micros",
    "ns": "ns nsec nanos nanosec",
    "s": "sec secs seconds",
}
_UNITS = {word: unit for unit, several in _CALLED.items() for word in several.split()}
"""Units as names have them, anywhere in the name"""
_LAST_UNITS = {"m": "m", "s": "s", "n": "N", "kn": "kN", "a": "A"}
"""Units of one letter, at the end only, behind another word"""
_PER_SECOND = {"deg": "deg/s", "rad": "rad/s", "mm": "mm/s", "m": "m/s"}
_PARTS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-zµ°]+|[A-Z]+|\d+")
_BRACKETS = re.compile(r"[\[(]\s*([^\])\d][^\])]*)[\])]\s*$")


@dataclass(frozen=True)
class ColumnName:
    """What the name of a column says."""

    name: str
    words: tuple[str, ...]
    """All of it, in small letters, numbers apart"""
    direction: str
    """Command or reading; empty if it does not tell, or tells both"""
    quantity: str
    """Position, velocity, effort or other; empty if it does not tell"""
    unit: str
    """Unit as machine.toml writes it, `A` of a current; empty if none is stated"""
    own: tuple[str, ...]
    """The words that say whose it is, without the numbers"""
    numbers: tuple[int, ...]
    time: bool
    """Whether it may name a clock"""

    @property
    def is_current(self) -> bool:
        """Whether it is a motor's current, by its unit or by its words."""
        return self.unit == "A" or (
            self.quantity == EFFORT and not self.unit and bool(_CURRENTS & {*self.words})
        )

    @property
    def family(self) -> tuple[str, ...]:
        """What it shares with the columns that differ from it in a number."""
        kept = [each for each in self.words if each not in _UNITS]
        if self.unit and kept and kept[-1] in _LAST_UNITS:
            kept.pop()
        return tuple("#" if each.isdecimal() else each for each in kept)


def split(name: str) -> tuple[str, ...]:
    """The words and numbers of a name in small letters: `jointPos[2]` is joint, pos, 2."""
    return tuple(each.lower() for each in _PARTS.findall(name))


def read(name: str, stated: str = "") -> ColumnName:
    """What a column's name says, and the unit that its file states."""
    bracket = _BRACKETS.search(name)
    inside = bracket[1].strip() if bracket else ""
    in_brackets = _unit_of(split(inside), inside)
    bare = name[: bracket.start()] if bracket and in_brackets else name
    words = split(bare)
    unit = stated or in_brackets or _unit_of(words, bare)
    left = tuple(w for w in words if w not in _UNITS and not w.isdecimal())
    if unit and len(left) > 1 and left[-1] in _LAST_UNITS:
        left = left[:-1]
    quantity = _quantity(left, unit)
    own = tuple(w for w in left if not _is_role(w, left))
    time = bool(_TIMES & {*words}) and not quantity
    if words[:1] == ("t",) and len(left) > 1 and left[1] not in _TIMES:
        time = False
    return ColumnName(name, words, _direction(left), quantity, unit, own, _numbers(words), time)


def own_words(name: str) -> tuple[str, ...]:
    """The words of a model's name without nouns that all things have, unless nothing else is left."""
    words = tuple(w for w in split(name) if not w.isdecimal())
    return tuple(w for w in words if w not in _NOUNS) or words


def numbers_of(name: str) -> tuple[int, ...]:
    """The numbers in a name."""
    return _numbers(split(name))


def _numbers(words: tuple[str, ...]) -> tuple[int, ...]:
    return tuple(int(w) for w in words if w.isdecimal())


def _is_role(word: str, words: tuple[str, ...]) -> bool:
    """Whether a word says what a column is, not whose."""
    return words[0] == "u" if word == "u" else word in _ROLES or word in _NOUNS


def _direction(words: tuple[str, ...]) -> str:
    """Command or reading; nothing where words say neither, or both."""
    if words[:1] == ("u",) or (_COMMANDS - {"u"}) & {*words}:
        return "" if _SURE & {*words} else COMMAND
    return READING if _READINGS & {*words} else ""


def _quantity(words: tuple[str, ...], unit: str) -> str:
    """The quantity of a column by its words, else by its unit."""
    for kind, several in _QUANTITIES:
        found = [w for w in words if w in several]
        if found and not (found == ["current"] and "position" in words):
            return kind
    if unit.endswith("/s"):
        return VELOCITY
    return EFFORT if unit in ("N m", "mN m", "A", "N", "kN") else ""


def _unit_of(words: tuple[str, ...], text: str) -> str:
    """The unit that words state, if they do."""
    if text.strip() in ("%", "°", "m", "s", "N", "A", "V", "1", "-"):
        return {"°": "deg", "-": "1"}.get(text.strip(), text.strip())
    found = next((_UNITS[w] for w in reversed(words) if w in _UNITS), "")
    last = words[-1] if words else ""
    if found == "rad" and words[-2:] == ("rad", "s"):
        return "rad/s"
    if found in _PER_SECOND and (last in ("s", "sec") and words[-2] in _UNITS):
        return _PER_SECOND[found]
    if found in _PER_SECOND and "dps" in words:
        return "deg/s"
    if found == "" and words[-2:] == ("m", "s") and len(words) > 2:
        return "m/s"
    if words[-2:] == ("n", "m"):
        return "N m"
    if not found and len(words) > 1 and last in _LAST_UNITS:
        return _LAST_UNITS[last]
    return found
