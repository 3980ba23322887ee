"""Which motors hang on which port, and where is the arm straight?"""

import json
import os
import shutil
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arm import N_MOTORS
from serpent_twin.bus import BusError
from serpent_twin.bus.limits import Limits
from serpent_twin.files import write_whole

_PER_MOTOR = ("ids", "direction", "zero", "homing_offset", "drive_mode")
_NEEDED = ("ids", "direction")
_WATCHDOG = (0.1, 2.54)
"""The watchdog's least and greatest time [s]: it is fed every 50 ms, and counts 127 × 20 ms at most."""
_PATIENCE = (0.1, 60.0)


@dataclass(frozen=True)
class ArmSetup:
    """One real arm on its bus: what a person enters, and what `serpent_twin.bus.zero` measured."""

    port: str = ""
    """Serial port, best as /dev/serial/by-id/…, which does not move"""
    baud: int = 1_000_000
    """[bit/s]"""
    ids: tuple[int, ...] = tuple(range(1, N_MOTORS + 1))
    """Ids of motors 1 … 10"""
    direction: tuple[int, ...] = (1,) * N_MOTORS
    """1 or −1 each: −1 where the servo's positive sense turns the arm's motor angle down"""
    zero: tuple[int, ...] = ()
    """Present Position with the arm straight [counts]; empty: never measured"""
    homing_offset: tuple[int, ...] = ()
    """Homing Offset (20) when zero was measured: if it changed, zero is void"""
    drive_mode: tuple[int, ...] = ()
    """Drive Mode (10) when zero was measured: likewise"""
    watchdog: float = 0.2
    """Silence after which the motors stop by themselves [s], in steps of 20 ms, 0.1 … 2.54"""
    patience: float = 3.0
    """How long a reading is tried, and a lost port waited for, before the arm is given up [s]"""
    limits: Limits = field(default_factory=Limits)
    """When the arm must stop"""
    path: Path | None = None
    """The file it came from; turn counts are kept beside it"""

    def __post_init__(self) -> None:
        if not isinstance(self.port, str):
            self._refuse("port must be a text")
        if not _is_int(self.baud) or self.baud <= 0:
            self._refuse(f"baud is {self.baud!r}; it must be a number of bits per second")
        for name in _PER_MOTOR:
            values = getattr(self, name)
            if not isinstance(values, tuple) or not all(map(_is_int, values)):
                self._refuse(f"{name} must be a list of whole numbers")
            if len(values) != N_MOTORS and (values or name in _NEEDED):
                self._refuse(f"{name} has {len(values)} values, but there are {N_MOTORS} motors")
        if len(set(self.ids)) < N_MOTORS or not all(0 <= i <= 252 for i in self.ids):
            self._refuse("ids must be ten different numbers from 0 to 252")
        if set(self.direction) - {1, -1}:
            self._refuse("direction must be 1 or -1 for each motor")
        for name, (least, most) in {"watchdog": _WATCHDOG, "patience": _PATIENCE}.items():
            value = getattr(self, name)
            if not isinstance(value, int | float) or not least <= value <= most:
                self._refuse(f"{name} is {value!r}; it must be from {least} to {most} s")

    @property
    def watchdog_words(self) -> int:
        """The watchdog's time in units of 20 ms, rounded down."""
        return int(self.watchdog / 0.02 + 1e-9)

    def _refuse(self, problem: str) -> None:
        raise BusError(f"{self.path or 'the arm setup'}: {problem}. Correct it there.")


def is_pseudo_terminal(port: str) -> bool:
    """Whether a port is no serial line but another program."""
    return os.path.realpath(port).startswith(("/dev/pts/", "/dev/ttys"))


def read_setup(path: Path) -> ArmSetup:
    """The setup in a TOML file as `write_setup` makes it; errors name the file and the key."""
    try:
        content = tomllib.loads(path.read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BusError(f"{path} is not TOML: {error}. Correct it or delete it.") from None
    limits = content.pop("limits", {})
    known = {f.name for f in fields(ArmSetup)} - {"path", "limits"}
    _refuse_unknown(path, content, known)
    if not isinstance(limits, dict):
        raise BusError(f"{path}: limits must be a table, [limits]. Correct it there.")
    _refuse_unknown(path, limits, _SI)
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in content.items()}
    return ArmSetup(**values, limits=_limits(path, limits), path=path)


def find_setup(path: Path, port: str = "") -> ArmSetup:
    """The setup in `path`, or the standard one kept there later; a given port takes precedence."""
    setup = read_setup(path) if path.exists() else ArmSetup(path=path)
    if port:
        setup = replace(setup, port=port)
    if not setup.port:
        raise BusError(
            f"no port: give --port, or write it into {path}. On Linux: ls /dev/serial/by-id"
        )
    return setup


def write_setup(setup: ArmSetup) -> Path:
    """Write the setup to its path; the file that was there stays beside it as *.before."""
    assert setup.path is not None
    keep_before(setup.path)
    write_whole(setup.path, _toml(setup))
    return setup.path


def keep_before(path: Path) -> None:
    """Copy a file that is about to be replaced to *.before."""
    if path.exists():
        shutil.copy2(path, path.with_name(path.name + ".before"))


# In the file, a limit's name carries its unit; angles are degrees, for people.
_SI = {
    "velocity_rad_s": ("velocity", 1.0),
    "joint_angle_deg": ("joint_angle", np.pi / 180),
    "load": ("load", 1.0),
    "load_time_s": ("load_time", 1.0),
}


def _limits(path: Path, found: Mapping[str, Any]) -> Limits:
    for key, value in found.items():
        if not isinstance(value, int | float):
            raise BusError(f"{path}: {key} is {value!r}; give a number. Correct it there.")
    try:
        return Limits(**{_SI[key][0]: _SI[key][1] * value for key, value in found.items()})
    except BusError as error:
        raise BusError(f"{path}: {error}") from None


def _toml(setup: ArmSetup) -> str:
    kept = {k: v for k, v in asdict(setup).items() if k not in ("path", "limits") and v != ()}
    lines = [
        "# One arm on its bus: edit port, ids, direction and limits; bus.zero measures the rest."
    ]
    lines += [f"{key} = {_value(value)}" for key, value in kept.items()]
    lines += ["", "[limits]  # beyond these the arm is stopped"]
    for key, (name, factor) in _SI.items():
        lines.append(f"{key} = {getattr(setup.limits, name) / factor:.6g}")
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    return f"[{', '.join(map(str, value))}]" if isinstance(value, tuple) else json.dumps(value)


def _is_int(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _refuse_unknown(path: Path, found: Mapping[str, Any], known: Any) -> None:
    unknown = sorted(found.keys() - set(known))
    if unknown:
        raise BusError(
            f"{path} has unknown keys {unknown}; known are {sorted(known)}. Correct it there."
        )
