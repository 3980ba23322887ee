"""Store which motors are on which port, and their positions when the arm is straight."""

import json
import os
import shutil
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import defstruct

from serpent_twin import stored
from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.limits import Limits
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.xl430 import CENTRE, Words
from serpent_twin.numerals import counted
from serpent_twin.runs.files import write_whole
from serpent_twin.stored import above, many, require_fields, within

_PER_MOTOR = ("zero", "homing_offset", "drive_mode")
"""Lists that are empty until they are measured"""
_Word = Annotated[int, within(-(2**31), 2**31 - 1)]
_Counts = Annotated[tuple[_Word, ...], many(0, N_MOTORS)]
_Ids = Annotated[tuple[Annotated[int, within(0, 252)], ...], many(N_MOTORS)]


@dataclass(frozen=True)
class ArmSetup:
    """One real arm on its bus: what a person enters, and what `serpent_twin.bus.zero` measured."""

    port: Annotated[str, many(0, 4096)] = ""
    """Serial port, best as /dev/serial/by-id/…, which does not move"""
    baud: Annotated[int, within(1, 10_000_000, "bit/s")] = 1_000_000
    """[bit/s]"""
    ids: _Ids = tuple(range(1, N_MOTORS + 1))
    """Ids of motors 1 … 10"""
    direction: Annotated[tuple[Literal[1, -1], ...], many(N_MOTORS)] = (1,) * N_MOTORS
    """1 or −1 each: −1 where the servo's positive sense turns the arm's motor angle down"""
    zero: _Counts = ()
    """Present Position with the arm straight [counts]; empty: never measured"""
    homing_offset: _Counts = ()
    """Homing Offset (20) when zero was measured: if it changed, zero is void"""
    drive_mode: _Counts = ()
    """Drive Mode (10) when zero was measured: likewise"""
    watchdog: Annotated[float, within(0.1, 2.54, "s")] = 0.2
    """Silence after which the motors stop by themselves [s], in steps of 20 ms: it is fed every 50 ms, and
    counts 127 × 20 ms at most"""
    patience: Annotated[float, within(0.1, 60.0, "s")] = 3.0
    """How long a reading is tried, and a lost port waited for, before the arm is given up [s]"""
    limits: Limits = field(default_factory=Limits)
    """When the arm must stop"""
    path: Path | None = None
    """The file it came from; turn counts are kept beside it"""

    def __post_init__(self) -> None:
        try:
            require_fields(self, "")
        except SerpentError as error:
            self._refuse(str(error).strip().rstrip("."))
        for name in _PER_MOTOR:
            if (count := len(getattr(self, name))) not in (0, N_MOTORS):
                self._refuse(
                    f"{name} has {counted(count, 'value')}, but there are {N_MOTORS} motors"
                )
        if len(set(self.ids)) < N_MOTORS:
            self._refuse("ids must be ten different numbers from 0 to 252")

    @property
    def straight(self) -> Words:
        """Present Position with the arm straight [counts], (10,): `zero`, or the middle of a turn."""
        return np.array(self.zero or (CENTRE,) * N_MOTORS)

    @property
    def watchdog_words(self) -> int:
        """The watchdog's time in units of 20 ms, rounded down."""
        return int(self.watchdog / 0.02 + 1e-9)

    def _refuse(self, problem: str) -> None:
        raise BusError(f"{self.path or 'the arm setup'}: {problem}. Correct it there.")


def is_pseudo_terminal(port: str) -> bool:
    """Whether a port is another program instead of a serial line."""
    return os.path.realpath(port).startswith(("/dev/pts/", "/dev/ttys"))


def read_setup(path: Path) -> ArmSetup:
    """The setup in a TOML file as `write_setup` makes it; errors name the file and the key."""
    try:
        given = stored.read_toml(path, advice=_ADVICE)
        file: Any = stored.take(given, _SetupFile, str(path), _ADVICE)
        limits = {key: getattr(file.limits, key) for key in given.get("limits", {})}
        values = {key: getattr(file, key) for key in given if key != "limits"}
        return ArmSetup(**values, limits=_limits(limits), path=path)
    except SerpentError as error:
        named = str(error).startswith(str(path))
        raise BusError(str(error) if named else f"{path}: {error}") from None


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


def setup_to_run(setup: ArmSetup) -> ArmSetup:
    """The setup that motors are driven by: it must know where the arm is straight.

    Simulated motors start straight in the middle of a turn unless a setup says otherwise.
    """
    if setup.zero:
        return setup
    if is_pseudo_terminal(setup.port):
        return replace(setup, zero=(CENTRE,) * N_MOTORS, path=None)
    raise BusError(
        f"{setup.path} holds no zero, so nobody knows where the arm is straight. {zero_again(setup)}"
    )


def zero_again(setup: ArmSetup) -> str:
    """Advice where the zero is missing, void or uncertain: it must not be set on a bent arm."""
    command = f"python -m serpent_twin.bus.zero --port {setup.port}"
    command += f" --setup {setup.path}" if setup.path else ""
    if is_pseudo_terminal(setup.port):
        return f"If the simulated arm is bent, restart the device; then run {command}."
    return f"Hang the arm straight, then run {command}."


def write_setup(setup: ArmSetup) -> Path:
    """Write the setup to its path; the file that was there stays beside it, see `keep_before`."""
    assert setup.path is not None
    keep_before(setup.path)
    write_whole(setup.path, _toml(setup))
    return setup.path


def keep_before(path: Path) -> None:
    """Copy a file that is about to be replaced to *.before, or *.before_2, … if that exists."""
    if not path.exists():
        return
    kept, n = path.with_name(f"{path.name}.before"), 1
    while kept.exists():
        n += 1
        kept = path.with_name(f"{path.name}.before_{n}")
    shutil.copy2(path, kept)


# In the file, a limit's name carries its unit; angles are in degrees, for people.
_SI = {
    "velocity_rad_s": ("velocity", 1.0),
    "joint_angle_deg": ("joint_angle", np.pi / 180),
    "load": ("load", 1.0),
    "load_time_s": ("load_time", 1.0),
}
_ADVICE = "Correct it there."


class _LimitsFile(stored.Form, frozen=True):
    """The limits in the file, see `Limits`; what is absent is as there."""

    velocity_rad_s: Annotated[float, above(0.0, 100.0, "rad/s")] = 0.0
    joint_angle_deg: Annotated[float, above(0.0, 360.0, "°")] = 0.0
    load: Annotated[float, above(0.0, 100.0, "of the stall torque")] = 0.0
    load_time_s: Annotated[float, above(0.0, 3600.0, "s")] = 0.0


_SetupFile = defstruct(
    "_SetupFile",
    [
        *((name, kind, None) for name, kind in stored.bounded(ArmSetup).items()),
        ("limits", _LimitsFile, _LimitsFile()),
    ],
    bases=(stored.Form,),
)


def _limits(found: dict[str, float]) -> Limits:
    return Limits(**{_SI[key][0]: _SI[key][1] * value for key, value in found.items()})


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
