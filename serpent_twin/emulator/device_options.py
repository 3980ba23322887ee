"""Define the options of the device."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import GIVEN, Checked, RateHz, Seed, Use, when
from serpent_twin.emulator.faults import Fault, Faults, help_text
from serpent_twin.emulator.motors import SimulatedMotors
from serpent_twin.emulator.natnet_server import SimulatedCameras
from serpent_twin.emulator.serving import Device
from serpent_twin.emulator.servos import Servos
from serpent_twin.emulator.terminal import Terminal
from serpent_twin.emulator.transcript import Transcript
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import Rigid
from serpent_twin.hardware.xl430 import CENTRE
from serpent_twin.numerals import counted
from serpent_twin.sim import arm_file, pushes
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.stored import within

CAMERAS = Rigid(
    np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([0.3, 1.4, -0.2])
)
"""Base to simulated cameras: y is up, as in Motive, and the base hangs 1.4 m above their origin."""
_FAULT_HELP = (
    "NAME=RATE[@MOTOR][/SECONDS], such as late=0.01@3/0.1; may be given again. RATE is a probability. "
    + help_text()
)
_NO_CONTROLLER = "is the controller's, and the device has none: leave it out."
Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]
_TIME, _ARM = Group("time"), Group("simulated arm")


@dataclass(frozen=True)
class DeviceOptions(Checked):
    """Put ten simulated XL430-W250 with the arm on a pseudo-terminal, for any program of yours.

    Prints the port, serves until Ctrl-C, then prints what it counted as one line of JSON. A line
    NAME [MOTOR [SECONDS]] on standard input lets a fault strike now, with - as MOTOR for any or none,
    such as `overload 3`, `reboot 4 0.5` or `unplug - 2`. The motors are as new, but set to ids 1 … 10 and
    1 MBd: position mode, torque off, return delay 500 µs. `--count 1 --baud 57600` is one from the box, as
    published examples expect it.

    Not simulated: gains but Position P, jerk control, weakness at low voltage, Protocol 1.0, and collisions
    of two motors with one id.
    """

    link: Path | None = None
    """A path that always leads to the port, such as /tmp/arm; the terminal's own number varies."""
    realtime: Annotated[Flag, _TIME, when(lockstep=False)] = False
    """Time follows the wall clock. This is the default."""
    lockstep: Annotated[Flag, _TIME] = False
    """Time stands still but for one control period after each group write of goals, which passes as
    fast as it computes: lengthen your port handler's timeout."""
    rate_hz: Annotated[RateHz, _TIME, when(lockstep=True)] = 4.0
    """Control periods per second of the motors' time, in lockstep."""
    fault: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(help=_FAULT_HELP)
    ] = ()
    """NAME=RATE[@MOTOR][/SECONDS], as `Fault.parse` reads them."""
    count: Annotated[int, within(0, N_MOTORS)] = 0
    """Number of motors on the wire; 0: as many as --ids, else ten. Fewer than ten come without the arm: their
    horns turn freely."""
    ids: tuple[Annotated[int, within(0, 252)], ...] = ()
    """Their ids; 1, 2, … without."""
    baud: Literal[9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000, 4500000] = 1000000
    """Their baud rate [bit/s]; 57600 from the box."""
    seed: Seed = 0
    """numpy.random.default_rng(SEED) draws the load noise, default_rng([SEED, 1]) the faults,
    default_rng([SEED, 2]) the cameras' noise."""
    start_counts: Annotated[tuple[Annotated[int, within(-(2**30), 2**30)], ...], _ARM] = (CENTRE,)
    """What the positions read at the start, with the arm straight: one number for all motors, or one each.
    Position mode has 0 … 4095, so that 0 leaves no way back."""
    paced: Annotated[Flag, _TIME, when(no_paced=False)] = False
    """Let packets take their time on the wire, and return delays; the default in real time."""
    no_paced: Annotated[Flag, _TIME] = False
    """Answer at once; the default in lockstep."""
    cameras: Annotated[int, within(0, 65_535), when(lockstep=False)] = 0
    """Port on which simulated cameras stream the arm's markers as Motive does (NatNet, unicast, y up), in
    real time; 1510 is Motive's own. 0: none."""
    transcript: Path | None = None
    """A new file for what really happened, as JSON lines: group reads, goals, faults, velocities."""
    until_eof: Flag = False
    """End when standard input ends, as it does when the program dies that started the device."""
    model: Annotated[Path | None, _ARM] = None
    """A twin.json, with all of its effects, or an MJCF file, instead of the arm built from the parameters
    below. MJCF still takes its load and marker noise from them."""
    push: Annotated[Path | None, _ARM] = None
    """A CSV file of known forces on links, as collect --push takes it; its times count from the start of the
    device. The transcript's reads state them."""
    parameters: Annotated[
        Parameters,
        _ARM,
        when(cameras=GIVEN, only=("marker_noise",)),
        Use(lambda _: _NO_CONTROLLER, only=("controller_gain",)),
    ] = NOMINAL
    """The simulated arm's free parameters."""

    @property
    def is_the_arm(self) -> bool:
        """Whether the motors are the ten that a run expects without a setup."""
        return not (self.count or self.ids) and self.baud == 1_000_000


def build(options: DeviceOptions) -> Device:
    """The device that the options describe; raises `SerpentError` on options that cannot be."""
    ids = _ids(options)
    _check(options, len(ids))
    faults = [Fault.parse(text) for text in options.fault]
    arm = arm_file.read(options.model, options.parameters, "--model")
    twin = arm.twin() if len(ids) == N_MOTORS else _free_horns(arm.design)
    twin.pushes = pushes.read(options.push) if options.push else ()
    parameters = twin.design.parameters
    period = 1 / options.rate_hz if options.lockstep else None
    if period is not None:
        twin.substeps(period)
    rng = np.random.default_rng(options.seed)
    start = np.resize(options.start_counts, N_MOTORS)
    motors = SimulatedMotors(twin, rng, parameters.load_noise, start_counts=start)
    draw = np.random.default_rng([options.seed, 1])
    terminal, cameras = Terminal(options.link), _cameras(options, parameters.marker_noise)
    transcript = Transcript(options.transcript, motors)  # last: what is refused leaves no file
    return Device(
        Servos(motors, ids, options.baud),
        terminal,
        Faults(faults, draw, transcript.fault, len(ids)),
        transcript,
        period,
        paced=options.paced or not (options.no_paced or options.lockstep),
        cameras=cameras,
    )


def _cameras(options: DeviceOptions, noise: float) -> SimulatedCameras | None:
    if not options.cameras:
        return None
    rng = np.random.default_rng([options.seed, 2])
    return SimulatedCameras(options.cameras, base_to_cameras=CAMERAS, rng=rng, noise=noise)


def _ids(options: DeviceOptions) -> tuple[int, ...]:
    ids = options.ids or tuple(range(1, (options.count or N_MOTORS) + 1))
    if len(set(ids)) < len(ids):
        raise SerpentError(
            f"--ids {' '.join(map(str, ids))} gives two motors one id; give each its own."
        )
    if len(ids) > N_MOTORS or options.count not in (0, len(ids)):
        most = f"{options.count or f'at most {N_MOTORS}'}"
        raise SerpentError(f"--ids has {counted(len(ids), 'number')}; give {most}, one a motor.")
    return ids


def _free_horns(design: TwinModel) -> Twin:
    """The arm's motors with cables that bear nothing."""
    model = design.spec().compile()
    for of_cable in (model.tendon_stiffness, model.tendon_damping, model.tendon_frictionloss):
        of_cable[:] = 0
    return Twin(design, model=model)


def _check(options: DeviceOptions, count: int) -> None:
    if len(options.start_counts) not in (1, count):
        raise SerpentError(
            f"--start-counts has {counted(len(options.start_counts), 'number')}; give 1"
            + (f" or {count}." if count > 1 else ".")
        )
    beside = {"--model": options.model, "--push": options.push, "--cameras": options.cameras}
    given = [flag for flag, value in beside.items() if value]
    if count < N_MOTORS and given:
        raise SerpentError(
            f"{given[0]} is for the arm, and {counted(count, 'motor')} come without it: leave it out, or "
            f"give all {N_MOTORS} motors."
        )
