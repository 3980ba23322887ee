"""Read what the name of a log's column says: command or reading, which quantity, unit and whose."""

import re
from dataclasses import dataclass

COMMAND, READING = "command", "reading"
"""What a column may be, by its name; nothing where it does not tell"""
POSITION, VELOCITY, EFFORT, OTHER = "position", "velocity", "effort", "other"
"""Which quantity it may be"""
_COMMANDS = (
    "cmd command commanded commands goal target desired des ctrl control con ref reference setpoint "
    "setpoints set sp action actions demand demanded requested request u"
)
_READINGS = (
    "meas measured measurement actual encoder enc state states fb feedback present observation obs "
    "real read reading sensor sensed current_position q theta"
)
_SURE = "meas measured actual present fb feedback observation"
_POSITIONS = "pos position positions q qpos theta angle angles ang encoder enc th phi displacement"
_VELOCITIES = "vel velocity velocities dq qd qvel rate speed omega dtheta thetad dot qdot thetadot"
_ACCELERATIONS = "acc accel acceleration ddq qdd ddot"
_EFFORTS = (
    "eff effort efforts tau torque torques current currents curr cur force forces load amp amps "
    "ampere iq trq pwm"
)
_OTHERS = (
    "temp temperature volt volts voltage battery bat batt counter count cnt loop seq sequence index idx "
    "frame error err status flag enable enabled cpu episode id mode power energy fault humidity pressure "
    "label task done reward noise latency"
)
_TIMES = (
    "t time times timestamp timestamps stamp clock sec secs seconds nsec nanosec millis micros tick "
    "ticks datetime date ts elapsed"
)
_NOUNS = (
    "joint joints states state axis axes motor motors servo servos actuator actuators act robot arm "
    "data observation action js jnt drive"
)
_UNITS = {
    "deg": "deg",
    "degs": "deg",
    "degree": "deg",
    "degrees": "deg",
    "°": "deg",
    "rad": "rad",
    "rads": "rad",
    "radian": "rad",
    "radians": "rad",
    "mrad": "mrad",
    "turn": "turn",
    "turns": "turn",
    "rev": "turn",
    "mm": "mm",
    "cm": "cm",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "um": "µm",
    "µm": "µm",
    "nm": "N m",
    "mnm": "mN m",
    "ms": "ms",
    "msec": "ms",
    "millis": "ms",
    "us": "µs",
    "µs": "µs",
    "usec": "µs",
    "micros": "µs",
    "ns": "ns",
    "nsec": "ns",
    "nanos": "ns",
    "nanosec": "ns",
    "sec": "s",
    "secs": "s",
    "seconds": "s",
}
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
    """As machine.toml writes it, `A` of a current; empty if it does not tell"""
    own: tuple[str, ...]
    """The words that say whose it is, without the numbers"""
    numbers: tuple[int, ...]
    time: bool
    """Whether it may name a clock"""

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
    bare = name[: bracket.start()] if bracket and _unit_of(split(inside), inside) else name
    words = split(bare)
    unit = stated or _unit_of(split(inside), inside) or _unit_of(words, bare)
    left = tuple(w for w in words if w not in _UNITS and not w.isdecimal())
    if unit and left and left[-1] in _LAST_UNITS and len(left) > 1:
        left = left[:-1]
    roles = _quantity(left, unit)
    own = tuple(w for w in left if not _is_role(w, left))
    numbers = tuple(int(w) for w in words if w.isdecimal())
    first = next(iter(words), "")
    time = any(w in _TIMES.split() for w in words) and not roles
    if first == "t" and len(left) > 1 and left[1] not in _TIMES.split():
        time = False
    return ColumnName(name, words, _direction(left), roles, unit, own, numbers, time)


def own_words(name: str) -> tuple[str, ...]:
    """The words of a model's name without nouns that all things have, unless nothing else is left."""
    words = tuple(w for w in split(name) if not w.isdecimal())
    return tuple(w for w in words if w not in _NOUNS.split()) or words


def numbers_of(name: str) -> tuple[int, ...]:
    """The numbers in a name."""
    return tuple(int(w) for w in split(name) if w.isdecimal())


def _is_role(word: str, words: tuple[str, ...]) -> bool:
    """Whether a word says what a column is, not whose."""
    if word == "u":
        return words[0] == "u"
    kinds = (_COMMANDS, _READINGS, _POSITIONS, _VELOCITIES, _ACCELERATIONS, _EFFORTS, _OTHERS)
    return any(word in each.split() for each in (*kinds, _NOUNS))


def _direction(words: tuple[str, ...]) -> str:
    command = any(w in _COMMANDS.split() for w in words if w != "u") or words[:1] == ("u",)
    reading = any(w in _READINGS.split() for w in words)
    sure = any(w in _SURE.split() for w in words)
    if command:
        return "" if sure else COMMAND
    return READING if reading else ""


def _quantity(words: tuple[str, ...], unit: str) -> str:
    """The quantity of a column; what is beside the point, such as a temperature, first."""
    kinds = (
        (OTHER, f"{_OTHERS} {_ACCELERATIONS}"),
        (VELOCITY, _VELOCITIES),
        (EFFORT, _EFFORTS),
        (POSITION, _POSITIONS),
    )
    for kind, several in kinds:
        found = [w for w in words if w in several.split()]
        if found == ["current"] and "position" in words:
            continue
        if found:
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
