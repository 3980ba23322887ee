"""Which motors hang on which port, and where is the arm straight?"""

import tomllib
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arm import N_MOTORS
from serpent_twin.bus import BusError
from serpent_twin.bus.limits import Limits
from serpent_twin.files import write_whole

_PER_MOTOR = ("ids", "direction", "zero", "homing_offset", "drive_mode")


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
    """Silence after which the motors stop by themselves [s], in steps of 20 ms, up to 2.54"""
    patience: float = 3.0
    """How long a lost port or motor is waited for [s]"""
    limits: Limits = field(default_factory=Limits)
    """When the arm must stop"""
    path: Path | None = None
    """The file it came from; turn counts are kept beside it"""

    def __post_init__(self) -> None:
        for name in _PER_MOTOR:
            values = getattr(self, name)
            if len(values) != N_MOTORS and (values or name in ("ids", "direction")):
                self._refuse(f"{name} has {len(values)} values, but there are {N_MOTORS} motors")
        if len(set(self.ids)) < N_MOTORS or not all(0 <= i <= 252 for i in self.ids):
            self._refuse("ids must be ten different numbers from 0 to 252")
        if set(self.direction) - {1, -1}:
            self._refuse("direction must be 1 or -1 for each motor")
        if not 0.02 <= self.watchdog <= 2.54:
            self._refuse(f"watchdog is {self.watchdog} s; it must be from 0.02 to 2.54 s")

    @property
    def watchdog_words(self) -> int:
        """The watchdog's time in units of 20 ms, rounded down, at least one."""
        return max(1, int(self.watchdog / 0.02 + 1e-9))

    def _refuse(self, problem: str) -> None:
        raise BusError(f"{self.path or 'the arm setup'}: {problem}. Correct it there.")


def read_setup(path: Path) -> ArmSetup:
    """The setup in a TOML file as `write_setup` makes it; errors name the file and the key."""
    try:
        content = tomllib.loads(path.read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BusError(f"{path} is not TOML: {error}. Correct it or delete it.") from None
    limits = content.pop("limits", {})
    limits = {
        _SI.get(key, (key, 1.0))[0]: _SI.get(key, (key, 1.0))[1] * value
        for key, value in limits.items()
    }
    _refuse_unknown(path, content, ArmSetup)
    _refuse_unknown(path, limits, Limits)
    values: dict[str, Any] = {
        key: tuple(v) if isinstance(v, list) else v for key, v in content.items()
    }
    try:
        return ArmSetup(**values, limits=Limits(**limits), path=path)
    except TypeError as error:
        raise BusError(
            f"{path} holds a value of the wrong kind: {error}. Correct it there."
        ) from None


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
    if setup.path.exists():
        setup.path.replace(setup.path.with_name(setup.path.name + ".before"))
    write_whole(setup.path, _toml(setup))
    return setup.path


# In the file, a limit's name carries its unit; angles are degrees, for people.
_SI = {
    "velocity_rad_s": ("velocity", 1.0),
    "joint_angle_deg": ("joint_angle", np.pi / 180),
    "load": ("load", 1.0),
    "load_time_s": ("load_time", 1.0),
}


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
    if isinstance(value, tuple):
        return f"[{', '.join(map(str, value))}]"
    return f'"{value}"' if isinstance(value, str) else str(value)


def _refuse_unknown(path: Path, found: dict[str, Any], kind: type) -> None:
    known = {f.name for f in fields(kind)} - {"path", "limits"}
    unknown = sorted(found.keys() - known)
    if unknown:
        raise BusError(
            f"{path} has unknown keys {unknown}; known are {sorted(known)}. Correct it there."
        )
