"""Hold the options of following a path."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import Checked, RateHz, Seed, when
from serpent_twin.recording.options import REAL, SIMULATED, RealArm
from serpent_twin.stored import within

_SHOWN = Group("recording")


@dataclass(frozen=True)
class Follow(Checked):
    """Let the arm follow a path, steered by its motor bus alone.

    The motion is rehearsed on the twin: how must the motors turn so that its joints go along the path, with
    cables that stretch and go slack, friction and gravity? On the way, an observer estimates the pose from
    the motors, and what the joints lack is added. What the arm cannot do is said before it moves.

    OUT gets the log (session_01.parquet), its figures (results.json), a picture (path.png) and a recording
    for rerun (session_01.rrd). A run that is stopped keeps its rows; it cannot be continued.
    """

    path: Path
    """The path, CSV or Parquet: time [s] with x, y, z of the gripper's end in the base frame [m], or with
    joint1 … joint9 [rad]."""
    out: Path
    """Folder for log, results, picture and recording; made if it does not exist."""
    twin: Path | None = None
    """The arm's twin.json, of python -m serpent_twin.trace. Without: the nominal twin, by which an arm
    that was built misses its path by centimetres."""
    backend: Literal["sim", "real"] = "sim"
    """sim: a simulated arm, as fast as it computes. real: the arm on its motor bus, in real time; see
    --port."""
    model: Path | None = None
    """What estimates the pose: a trained readout, OUT/models/NAME of python -m serpent_twin.train. Without:
    the twin, driven by the motors' angles."""
    feedback: Annotated[float, within(0.0, 10.0, "1/s")] = 1.0
    """Share of what the joints are estimated to lack that is added in a second [1/s]; 0: the arm moves as
    rehearsed, whatever is estimated."""
    wider: Annotated[float, within(0.5, 2.0)] = 1.0
    """Times the joints' usual range, -22.5 ... 22.5 degrees for odd joints and 0 ... 22.5 for even ones, in
    which poses are sought. The logs that the twin was traced from hardly go beyond."""
    rate_hz: RateHz = 20.0
    """Control steps per second."""
    simulate: Annotated[Path | None, SIMULATED, when(backend="sim")] = None
    """The arm to simulate, for --backend sim: another twin.json. Without: the twin itself."""
    markers: Annotated[bool, SIMULATED, when(backend="sim")] = True
    """Let simulated cameras measure the markers, so that the error is known. Nothing is steered by them."""
    seed: Annotated[Seed, SIMULATED, when(backend="sim")] = 0
    """Seed of the simulated sensors' noise."""
    prior_runtime_h: Annotated[float, within(0.0, 1e5, "h")] = 0.0
    """How long the arm has run since its cables were strung [h], for effects of wear."""
    arm: str = ""
    """Name of the arm, stored in the log; without: twin, or the setup file's name."""
    record: Annotated[bool, _SHOWN] = True
    """Write OUT/session_01.rrd for rerun."""
    view: Annotated[bool, _SHOWN] = False
    """Show it in rerun's viewer while it happens."""
    real: Annotated[RealArm, REAL, when(backend="real")] = field(default_factory=RealArm)
    """The real arm, for --backend real."""

    @property
    def prior_runtime_s(self) -> float:
        """Time that the arm ran before [s]."""
        return 3600.0 * self.prior_runtime_h
