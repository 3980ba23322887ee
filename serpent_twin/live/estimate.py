"""Estimate the arm's pose while it moves, from its motor bus alone."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from serpent_twin import estimators
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import Checked, RateHz, Seed, Steps, Use, when
from serpent_twin.errors import SerpentError
from serpent_twin.live.arm import Drive, is_known, note, of_readout
from serpent_twin.live.figures import Course, figures, told
from serpent_twin.live.follower import Follower
from serpent_twin.live.run import LivePlan, run
from serpent_twin.recording import collect, lost_markers
from serpent_twin.recording.collect import OF_ARM, REAL, SIMULATED, RealArm
from serpent_twin.recording.ending import why
from serpent_twin.runs.files import write_json
from serpent_twin.runs.provenance import file_hash, provenance
from serpent_twin.runs.run_lock import claimed
from serpent_twin.sim import arm_file, twin_model
from serpent_twin.stored import within

SETTINGS = "estimate.json"
RESULTS = "results.json"
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
    """For --backend sim: the arm's free parameters. The controller's gain is also the real arm's."""

    @property
    def prior_runtime_s(self) -> float:
        """Time that the arm ran before [s]."""
        return 3600.0 * self.prior_runtime_h


def estimate(config: Estimate) -> dict[str, Any]:
    """Drive, estimate and log; returns what results.json holds, also of a run that is stopped."""
    plan = planned(config)
    if plan.note:
        print(plan.note)
    follower = Follower(plan.estimator, config.steps, config.learn, config.prior_runtime_s)
    course = Course(config.steps)
    said = settings(plan)
    with claimed(config.out, SETTINGS, said):
        _refuse_second(plan)
        ended = None
        try:
            run(plan, follower, course)
        except BaseException as error:
            ended = why(error)
            raise
        finally:
            results = {"complete": ended is None, "ended": ended, "rate_hz": config.rate_hz}
            results |= {"simulated_arm": plan.note, "trained_on_simulated_arm": plan.trained_on_it}
            if course.rows:
                results |= figures(course, follower, 1 / config.rate_hz)
                print(told(results))
                results |= {"seed": config.seed, "settings": said} | provenance()
                write_json(config.out / RESULTS, results)
        lost_markers.build_diagnosis([plan.session])
    return results


def planned(config: Estimate) -> LivePlan:
    """Estimator and arm of a config, checked; nothing is written and nothing moves."""
    trained = estimator = estimators.load(config.model)
    simulated = config.simulate
    if config.twin and trained.takes_twin:
        estimator = trained.with_twin(twin_model.read(config.twin))
    elif config.twin:
        if simulated or config.backend == "real":
            raise SerpentError(
                f"--twin {config.twin}: the readout {estimator.name} in {config.model} has no twin that "
                "could be replaced. Leave --twin out, or give a trained observer as --model."
            )
        simulated = config.twin
    if config.prior_runtime_h and config.backend == "real" and estimator.own_twin is None:
        raise SerpentError(
            f"--prior-runtime-h would be ignored: the readout {estimator.name} has no twin that could wear. "
            "Leave it out."
        )
    if config.backend == "sim":
        arm_file.read(simulated, config.parameters, "--simulate")
    drive = Drive(
        out=config.out,
        backend=config.backend,
        sessions=1,
        steps=config.steps,
        rate_hz=config.rate_hz,
        seed=config.seed,
        arm=config.arm,
        twin=simulated,
        real=config.real,
        parameters=config.parameters,
        prior_runtime=config.prior_runtime_s,
    )
    drive = of_readout(drive, trained)
    collect.check(drive)
    estimator.require_rate(config.rate_hz)
    if config.backend == "real":
        return LivePlan(config, estimator, drive)
    other = f" It estimates by {config.twin}." if estimator is not trained else ""
    return LivePlan(
        config, estimator, drive, note(drive, trained) + other, is_known(drive, trained)
    )


def settings(plan: LivePlan) -> dict[str, Any]:
    """The options of the run, and the hashes of its input files."""
    config = plan.config
    files = ("readout.json", "learned.npz")
    return collect.settings(plan.drive) | {
        "readout": plan.estimator.name,
        "readout_sha256": {name: file_hash(config.model / name) for name in files},
        "twin_sha256": config.twin and file_hash(config.twin),
        "simulate_sha256": config.simulate and file_hash(config.simulate),
        "learn": config.learn,
        "prior_runtime_h": config.prior_runtime_h,
        "markers": config.real.mocap if config.backend == "real" else config.markers,
    }


def _refuse_second(plan: LivePlan) -> None:
    names = (f"{plan.session.stem}.*", RESULTS)
    if found := [path for name in names for path in sorted(plan.config.out.glob(name))]:
        raise SerpentError(
            f"{plan.config.out} holds a run already ({', '.join(path.name for path in found)}), and an "
            "arm that moved is not gone on with. Nothing was changed: choose another --out."
        )
