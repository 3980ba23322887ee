"""Hold the options of a live estimate."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import Checked, RateHz, Seed, Steps, Use, when
from serpent_twin.recording.options import OF_ARM, REAL, SIMULATED, RealArm
from serpent_twin.stored import within

_SHOWN = Group("recording")


def _blind(config: "Estimate") -> str:
    if config.backend == "sim":
        blind, way = not config.markers, "leave out one of --learn and --no-markers"
    else:
        blind, way = config.real.mocap == "none", "leave it out, or add --mocap natnet"
    return blind * f"learns from markers, and this run sees none: {way}."


@dataclass(frozen=True)
class Estimate(Checked):
    """Estimate where the arm is while it moves, from its motor bus alone, and log that.

    The arm follows random joint targets as in `collect`. OUT gets the log with the estimates as further
    columns (session_01.parquet), what is known at the end (results.json), and a recording for rerun
    (session_01.rrd). A run that is stopped keeps its rows; it cannot be continued.
    """

    model: Path
    """A trained readout, OUT/models/NAME of python -m serpent_twin.train."""
    out: Path
    """Folder for log, results and recording; made if it does not exist."""
    backend: Literal["sim", "real"] = "sim"
    """sim: the twin, as fast as it computes. real: the arm on its motor bus, in real time; see --port."""
    twin: Path | None = None
    """A twin.json. For an observer: its twin, in place of the one that it was trained with. Another
    readout has no twin: then it is the arm to simulate, as if given to --simulate."""
    simulate: Annotated[Path | None, SIMULATED, when(backend="sim")] = None
    """The arm to simulate, for --backend sim: a twin.json, with all of its effects, or an MJCF file. Without:
    the twin that the readout was trained with, if it has one, or an arm of the parameters below. It is never
    what estimates."""
    steps: Steps = 2100
    """Control steps, that is rows."""
    rate_hz: RateHz = 4.0
    """Control steps per second. A readout of windows takes the rate it was trained for; an observer takes
    any, but its stated uncertainty holds for the rate it was trained for."""
    seed: Seed = 0
    """Seed of targets and noise."""
    prior_runtime_h: Annotated[float, within(0.0, 1e5, "h")] = 0.0
    """How long the arm has run since its cables were strung [h], for effects of wear in the simulated arm and
    in a readout's twin. 0: the cables are new, or nothing wears."""
    arm: str = ""
    """Name of the arm, stored in the log; without: twin, or the setup file's name."""
    markers: Annotated[bool, SIMULATED, when(backend="sim")] = True
    """Let simulated cameras measure the markers, so that the error is known. No readout gets
    them, but for --learn."""
    force: bool = False
    """Also feel the force on the arm, where it acts, and whether anything touches it: --model must be an
    observer. Its twin's loads are what the force is told from, so give a twin that was traced."""
    push: Annotated[str, SIMULATED, when(backend="sim")] = ""
    """Push links of the simulated arm with known forces, as collect --push does: how many random pushes, or a
    CSV file."""
    learn: Annotated[bool, Use(_blind)] = False
    """Let the markers of each step correct later estimates while there are any, by recursive least squares:
    for an arm that has changed since the readout was trained. The correction is held when they go."""
    record: Annotated[bool, _SHOWN] = True
    """Write OUT/session_01.rrd for rerun."""
    view: Annotated[bool, _SHOWN] = False
    """Show it in rerun's viewer while it happens."""
    real: Annotated[RealArm, REAL, when(backend="real")] = field(default_factory=RealArm)
    """The real arm, for --backend real."""
    parameters: Annotated[
        Parameters, SIMULATED, OF_ARM, when(markers=True, only=("marker_noise",))
    ] = NOMINAL
    """The arm's free parameters, for --backend sim. The controller's gain is also the real arm's."""

    @property
    def prior_runtime_s(self) -> float:
        """Time that the arm ran before [s]."""
        return 3600.0 * self.prior_runtime_h
