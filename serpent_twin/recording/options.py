"""Hold the options of a recording."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from serpent_twin.arm.control import random_targets
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.arrays import Array
from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import (
    ABSENT,
    Checked,
    RateHz,
    Seed,
    Sessions,
    Steps,
    Workers,
    when,
)
from serpent_twin.hardware.natnet_live import NatNet
from serpent_twin.recording.motion import read as read_motion
from serpent_twin.sim import arm_file
from serpent_twin.sim.arm_file import ArmFile
from serpent_twin.sim.pushes import Push, drawn
from serpent_twin.sim.pushes import read as read_pushes
from serpent_twin.stored import within

REAL, CAMERAS, SIMULATED = Group("real arm"), Group("camera"), Group("simulated arm")
_SIM = when(backend="sim")
OF_ARM = when(backend="sim", but=("controller_gain",))
"""The simulated arm's parameters: the controller's gain is also the real arm's"""


@dataclass(frozen=True)
class RealArm:
    """Where the real arm and its cameras are."""

    port: str = ""
    """Serial port of the motors, such as /dev/serial/by-id/…; else the one in --setup."""
    setup: Path = Path("arm.toml")
    """The arm's setup: ids, directions, zero and limits; python -m serpent_twin.bus.zero writes it."""
    mocap: Annotated[Literal["none", "natnet"], CAMERAS] = "none"
    """natnet: markers from Motive, live. none: a log without markers; merge a take afterwards."""
    natnet: Annotated[NatNet, CAMERAS, when(mocap="natnet")] = field(default_factory=NatNet)
    """Where Motive streams, for --mocap natnet."""
    frame: Annotated[Path, CAMERAS, when(mocap="natnet")] = Path("frame.json")
    """Where the cameras see the arm's base; python -m serpent_twin.mocap frame writes it."""


@dataclass(frozen=True)
class Collect(Checked):
    """Collect session logs of an arm that follows random joint targets, or a planned motion.

    Each session becomes OUT/session_NN.parquet. After an interruption, the same command continues with what
    is missing, and a larger --sessions adds to a finished run.
    """

    out: Path
    """Folder for the session logs; made if it does not exist."""
    backend: Literal["sim", "real"] = "sim"
    """sim: the twin, as fast as it computes. real: the arm on its motor bus; see --port."""
    sessions: Sessions = 23
    """Number of sessions."""
    steps: Annotated[Steps, when(motion=ABSENT)] = 2100
    """Control steps, that is rows, of each session."""
    motion: Path | None = None
    """Motion to follow in each session, in place of random targets: python -m serpent_twin.plan writes it."""
    rate_hz: RateHz = 4.0
    """Control steps per second."""
    seed: Seed = 0
    """Seed of targets and noise; session n of seed s is always the same."""
    arm: str = ""
    """Name of the arm, stored in the logs; without: twin, or the setup file's name."""
    marker_loss: Annotated[float, within(0.0, 0.99), SIMULATED, _SIM] = 0.0
    """Share of marker readings that the simulated cameras lose."""
    push: Annotated[str, _SIM] = ""
    """Push links of the simulated arm with known forces, which the logs state in push_link, push_x, push_y,
    push_z: a number, so many random pushes in each session; or a CSV file with a push a line, its columns
    link, begin, end [s], force_x, force_y, force_z [N, base frame], shape (step, ramp, swing) and rate [Hz].
    """
    workers: Annotated[Workers, SIMULATED, _SIM] = 0
    """Processes that simulate side by side; 0 for one a core. The logs do not depend on it."""
    twin: Annotated[Path | None, SIMULATED, _SIM] = None
    """The arm to simulate, in place of the parameters below: a twin.json, with all of its effects, or
    its twin.xml, which takes its noise and the controller's gain from them."""
    real: Annotated[RealArm, REAL, when(backend="real")] = field(default_factory=RealArm)
    """The real arm, for --backend real."""
    parameters: Annotated[Parameters, SIMULATED, OF_ARM] = NOMINAL
    """Free parameters of the arm, for --backend sim. The controller's gain is also the real arm's."""

    @property
    def arm_name(self) -> str:
        """The arm's name in the logs."""
        return self.arm or ("twin" if self.backend == "sim" else self.real.setup.stem)

    @property
    def rows(self) -> int:
        """Control steps of each session."""
        return len(read_motion(self.motion).targets) if self.motion else self.steps

    def targets(self, rng: np.random.Generator) -> Array:
        """Joint targets of a session [rad], (rows, 9): the planned motion's, or random ones."""
        if self.motion:
            return read_motion(self.motion).targets
        return random_targets(self.steps, rng)

    @property
    def random_pushes(self) -> int | None:
        """How many random pushes each session has; None where a file states them, or there are none."""
        return int(self.push) if self.push.isdecimal() else None

    def pushes(self, rng: np.random.Generator) -> tuple[Push, ...]:
        """What pushes the simulated arm in a session: the file's pushes, or random ones."""
        if not self.push:
            return ()
        if self.random_pushes is not None:
            return drawn(rng, self.random_pushes, self.rows / self.rate_hz)
        return read_pushes(Path(self.push))

    def simulated(self) -> ArmFile:
        """The arm to simulate."""
        return arm_file.read(self.twin, self.parameters)
