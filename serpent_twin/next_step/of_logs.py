"""Suggest the next command after logs, readouts, a trace or a live estimate were written."""

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.next_step.words import Words, allowed, at_rate, flags, named_after, typed
from serpent_twin.runs.files import unused

if TYPE_CHECKING:  # each command imports this module, which imports the others when it checks them
    from serpent_twin.following.options import Follow
    from serpent_twin.identification import Trace
    from serpent_twin.identification.check_logs import Check
    from serpent_twin.live.options import Estimate
    from serpent_twin.reservoir.sweep.run import Sweep
    from serpent_twin.training.train import TrainingPlan

ALIKE = 1.05
"""Times the least error, up to which a readout is as good as the best"""


def after_logs(folder: Path, beside: Path) -> Words | None:
    """After session logs were written or looked at: train on them; on too few, replay one."""
    from serpent_twin import sessions
    from serpent_twin.training.train import Train, planned

    files = sessions.session_files(folder)
    if not files:
        return None
    out, twin = named_after(beside, folder, "logs", "readouts"), _twin_file(files[0])
    if allowed(lambda: planned(Train(folder, out, twin=twin))):
        given = ["--twin", str(twin)] if twin else []
        return ["serpent_twin.train", "--logs", str(folder), *given, "--out", str(out)]
    return replay(files[0], beside)


def after_look(path: Path) -> Words | None:
    """After a look at a folder of session logs or at one: as after they were written, here; at an imported
    one: replay it.
    """
    return after_logs(path, Path()) if path.is_dir() else replay(path, Path())


def after_import(folder: Path, machine: Path | None) -> Words | None:
    """After logs of another machine were imported: check what they tell of it, else look at them."""
    from serpent_twin.machines import find

    if machine and allowed(lambda: find(str(machine)).read(folder)):
        return ["serpent_twin.check", "--machine", str(machine), "--logs", str(folder)]
    return ["serpent_twin.log", "info", str(folder)]


def after_recovery(path: Path) -> Words | None:
    """After recordings were recovered: look at what is there."""
    from serpent_twin import sessions

    folder = path if path.is_dir() else path.parent
    if not sessions.session_files(folder) or not allowed(lambda: sessions.read_folder(folder)):
        return None
    return ["serpent_twin.log", "info", str(folder)]


def after_training(plan: "TrainingPlan", scores: Mapping[str, Any]) -> Words | None:
    """After training: trace an arm whose twin has not been fitted, else follow it by the best readout."""
    if not plan.twin.settled and not plan.adaptation and (step := trace(plan)):
        return step
    return estimate(plan, scores)


def without_observer(plan: "TrainingPlan") -> str:
    """Why the observer was not trained, and what trains it; nothing if it was, or others were asked for."""
    if plan.twin.design or plan.config.readout:
        return ""
    why = (
        "The observer, which simulates the arm, was not trained: the twin of this arm is not known."
    )
    tracing = trace(plan)
    if not tracing:
        return f"{why} Give it with --twin."
    out = unused(plan.config.out.with_name(f"{plan.config.out.name}_with_twin"))
    twin = ["--twin", str(Path(tracing[-1]) / "twin.json")]
    again = ["serpent_twin.train", "--logs", str(plan.config.logs), *twin, "--out", str(out)]
    return f"{why} To train it: {typed(tracing)}, then {typed(again)}"


def trace(plan: "TrainingPlan") -> Words | None:
    """Trace the logs that were trained on, if they can be."""
    from serpent_twin.identification.run import Trace, planned
    from serpent_twin.machines.arm.pieces import segments

    logs, out = plan.config.logs, plan.config.out
    where = named_after(out.parent, logs, "logs", "trace")
    if not allowed(lambda: [segments(part) for part in planned(Trace((logs,), where))[1:]]):
        return None
    return ["serpent_twin.trace", "--logs", str(logs), "--out", str(where)]


def after_check(config: "Check") -> Words | None:
    """After a check of what logs can tell: trace them, if they can be."""
    from serpent_twin.identification.run import Trace, planned

    where = named_after(Path(), config.logs[-1], "logs", "trace")
    if not allowed(lambda: planned(Trace(config.logs, where, config.rig, config.machine))):
        return None
    rig = [] if config.rig == "arm" else ["--rig", config.rig]
    rig = ["--machine", str(config.machine)] if config.machine else rig
    return ["serpent_twin.trace", "--logs", *map(str, config.logs), *rig, "--out", str(where)]


def estimate(plan: "TrainingPlan", scores: Mapping[str, Any]) -> Words | None:
    """Follow the arm by the readout of the least error that can."""
    from serpent_twin.live.estimate import planned
    from serpent_twin.live.options import Estimate

    out = plan.config.out
    where, rate = unused(out.parent / "live"), plan.sessions.test[0].rate_hz
    for model in _best_first(out, scores):
        if allowed(lambda m=model: planned(Estimate(m, where, rate_hz=rate))):
            return [
                "serpent_twin.estimate",
                "--model",
                str(model),
                *at_rate(rate),
                "--out",
                str(where),
            ]
    return None


def after_trace(config: "Trace") -> Words | None:
    """After a trace of the arm: collect from the corrected twin, at the logs' rate. Of another machine: take
    the corrected twin to any MuJoCo program.
    """
    from serpent_twin import sessions
    from serpent_twin.recording.collect import check
    from serpent_twin.recording.options import Collect

    if config.machine:
        twin, out = config.out / "twin.json", unused(config.out / "robot_twin.xml")
        return ["serpent_twin.export", str(twin), "--to", "mjcf", "--out", str(out)]
    if config.named != "arm":
        return None
    twin, out = (
        config.out / "twin.json",
        named_after(config.out.parent, config.out, "trace", "corrected"),
    )
    rate = sessions.read_session(sessions.session_files(config.logs[0])[0]).rate_hz
    if not allowed(lambda: check(Collect(out, twin=twin, rate_hz=rate))):
        return None
    return ["serpent_twin.collect", "--twin", str(twin), *at_rate(rate), "--out", str(out)]


def after_plan(motion: Path, rate_hz: float, arm: str) -> Words:
    """After a motion was planned: let the arm follow it."""
    out = named_after(motion.parent, motion.with_suffix(""), "motion", "next_logs")
    named = ["--arm", arm] if arm else []
    given = ["--motion", str(motion), *named, "--sessions", "2", *at_rate(rate_hz)]
    return ["serpent_twin.collect", "--backend", "real", *given, "--out", str(out)]


def after_sweep(config: "Sweep", table: Mapping[str, Any]) -> Words | None:
    """After a sweep: sessions of its softest arm, which readouts can be trained on."""
    from serpent_twin.recording.collect import check
    from serpent_twin.recording.options import Collect

    stiffness = "strand_stiffness"
    arms = [each for each in table["points"] if stiffness in each["arm"] and not each["failed"]]
    if not arms:
        return None
    softest = min(arms, key=lambda each: each["arm"][stiffness])
    arm, rate = Parameters(**softest["arm"]), softest["point"]["command_rate_hz"]
    out = unused(config.out.parent / "softest")
    if not allowed(lambda: check(Collect(out, rate_hz=rate, parameters=arm))):
        return None
    changed = flags(arm, NOMINAL)
    return ["serpent_twin.collect", *changed, *at_rate(rate), "--out", str(out)]


def after_estimate(config: "Estimate") -> Words | None:
    """After a live run: replay its log, the readout's estimates beside the measurement."""
    session, twin = config.out / "session_01.parquet", config.twin or config.simulate
    return replay(session, config.out.parent, config.model, twin)


def after_follow(config: "Follow") -> Words | None:
    """After a path was followed: replay its log."""
    session = config.out / "session_01.parquet"
    return replay(session, config.out.parent, config.model, config.twin)


def replay(
    session: Path, beside: Path, model: Path | None = None, twin: Path | None = None
) -> Words | None:
    """Replay a session, with readout and twin where these fit it."""
    from serpent_twin import estimators, sessions
    from serpent_twin.exchange.imported_log import is_other
    from serpent_twin.playback import corrected_twin
    from serpent_twin.readouts.windows import cut

    def read() -> sessions.Session:
        seen = sessions.read_session(session)
        sessions.refuse_damaged([seen])
        return seen

    def estimated() -> None:
        assert model is not None
        estimator, seen = estimators.load(model), read()
        estimator.require_rate(seen.rate_hz)
        cut([seen], estimator.trained.window, drop=0)

    if not is_other(session) and not allowed(read):
        return None
    words = ["serpent_twin.replay", str(session)]
    if model and allowed(estimated):
        words += ["--readout", str(model)]
    if twin and twin.suffix == ".json" and allowed(lambda: corrected_twin(twin, read())):
        words += ["--twin", str(twin)]
    name = f"{session.parent.name}_{session.stem}.rrd".lstrip("_")
    return [*words, "--out", str(unused(beside / name))]


def after_replay(recording: Path) -> Words:
    """After a recording was made: look at it; in a browser where there is no display."""
    shown = sys.platform != "linux" or {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys()
    return ["rerun", *([] if shown else ["--serve-web"]), str(recording)]


def _twin_file(session: Path) -> Path | None:
    """The twin.json that a session was collected from, if it is still there."""
    from serpent_twin import sessions
    from serpent_twin.runs.provenance import file_hash

    twin = sessions.read_session(session).metadata.get("twin")
    if not isinstance(twin, dict):
        return None
    path = Path(str(twin.get("path")))
    there = path.suffix == ".json" and path.is_file()
    return path if there and file_hash(path) == twin.get("sha256") else None


def _best_first(out: Path, scores: Mapping[str, Any]) -> list[Path]:
    """Trained readouts, those of the least error first and of these the quickest; if an arm was adapted to,
    by their errors on it.
    """
    found = {out / "models" / n: each for n, each in scores["readouts"].items()}
    for name, of in (scores.get("adapt") or {"windows": {}})["windows"].items():
        for count, each in of.items():
            place = out / "models" / name if count == "0" else out / "adapted" / count / name
            found[place] = each
    alike = ALIKE * min(each["mean_mm"] for each in found.values())

    def rank(place: Path) -> tuple[float, float]:
        each = found[place]
        return max(alike, each["mean_mm"]), each["latency_ms"]

    return sorted(found, key=rank)
