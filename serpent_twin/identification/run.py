"""Run a trace from its options, and write its results."""

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tyro.conf import arg

from serpent_twin import machines
from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import ABSENT, Checked, Seed, when
from serpent_twin.engine.exact_xml import first_comment
from serpent_twin.errors import SerpentError
from serpent_twin.identification.acceptance import Selection
from serpent_twin.identification.build_diagnosis import build_diagnosis
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.composing import ComposingTracer
from serpent_twin.identification.diagnosis import Diagnosis
from serpent_twin.identification.first_guess import guessed
from serpent_twin.identification.first_picture import begin_report
from serpent_twin.identification.fitting.uncertainty import drawn
from serpent_twin.identification.in_rows import in_rows
from serpent_twin.identification.kept_fit import keep
from serpent_twin.identification.page import page
from serpent_twin.identification.refitting import RefittingTracer
from serpent_twin.identification.steps import Tracer
from serpent_twin.identification.summary import summary
from serpent_twin.machines.rig import is_named, notes_on, read_logs
from serpent_twin.numerals import counted, listed
from serpent_twin.runs.files import finite, write_json
from serpent_twin.runs.progress import Progress
from serpent_twin.runs.provenance import file_hash, provenance, versions
from serpent_twin.runs.report import versions_text, write
from serpent_twin.runs.run_lock import claimed
from serpent_twin.stored import names, within
from serpent_twin.tables.log import Log
from serpent_twin.tables.repeated import refuse_repeated

SETTINGS = "trace.json"
_SESSIONS = Group("session")


@dataclass(frozen=True)
class Trace(Checked):
    """Find what the twin of a logged machine lacks, add it, and show the error before and after.

    OUT gets diagnosis.json, report.html, report.md, figures, and the corrected twin (twin.json,
    twin.xml), which collect --twin, the device's --model and replay --twin take. A run that was
    interrupted goes on when the same command is given again.
    """

    logs: tuple[Path, ...]
    """Folder or file with the session logs of one machine; or several, the oldest first."""
    out: Path
    """Folder for results; made if it does not exist."""
    rig: Annotated[
        str, arg(help=f"The kind of machine: {machines.described()}."), when(machine=ABSENT)
    ] = "arm"
    """Name of the kind of machine."""
    machine: Path | None = None
    """The machine.toml of any other machine, or its folder."""
    held_out: Annotated[
        Annotated[int, within(1, 10_000)] | tuple[Path, ...], _SESSIONS, when(judge=ABSENT)
    ] = 1
    """Number of held-out sessions, the last ones; or files or folders with them, among LOGS or elsewhere.
    Nothing is fitted to them, and they are the test."""
    judge: Annotated[str, _SESSIONS] = ""
    """Names of the held-out files or sessions among LOGS, in place of the last ones, such as kp200_*.parquet.
    """
    sessions: Annotated[int, within(0, 10_000), _SESSIONS] = 0
    """Use only this many sessions, the first ones, files of --held-out not counted; 0 for all."""
    seed: Seed = 0
    """Seed of bootstrap and permutations."""
    discover: bool = True
    """Also compose effects that no catalogue lists, where the named ones leave something: laws at places of
    the machine. That takes some minutes more, and not every machine says what its places show."""
    minutes: Annotated[float, within(0.1, 10_000.0, "min")] = 600.0
    """Time after which no further effect is sought; the fit of the effects found so far is finished."""
    twins: Annotated[int, within(0, 1000)] = 0
    """Also write this many twins that the logs cannot distinguish from the corrected one, drawn from the
    uncertainty of the fit: OUT/twins/drawn_NN.json; and OUT/twins/calibrated.json, without effects. A later
    run of the same command can add them."""

    @property
    def named(self) -> str:
        """The machine's name, or the path of its machine.toml."""
        return machines.named(self.rig, self.machine)

    @property
    def sources(self) -> tuple[Path, ...]:
        """Folders and files of all sessions, those that are held out included."""
        if isinstance(self.held_out, int):
            return self.logs
        return *self.logs, *(each for each in self.held_out if not _lies_in(each, self.logs))


def trace(config: Trace) -> dict[str, Any]:
    """Trace a folder of logs; returns what diagnosis.json holds."""
    return trace_sessions(config, *planned(config))[1]


def planned(config: Trace) -> tuple[machines.Rig, Sequence[Any], Sequence[Any]]:
    """The machine, the training sessions and the held-out ones, of a config that can be traced."""
    rig = machines.find(config.named)
    return rig, *_split(config, read_logs(rig, config.sources))


def _split(config: Trace, sessions: Sequence[Log]) -> tuple[list[Log], list[Log]]:
    """The sessions that are fitted to, and the held-out ones."""
    if not isinstance(config.held_out, int):
        return _apart(config, sessions, config.held_out)
    sessions = sessions[: config.sessions or None]
    if config.judge:
        judging = [s for s in sessions if is_named(s, config.judge)]
        if not judging or len(judging) == len(sessions):
            raise SerpentError(
                f"--judge {config.judge} names {len(judging)} of the {counted(len(sessions), 'session')} in "
                f"{listed(config.logs)}: some must judge and some be fitted. Name others, several by one "
                f"pattern with *, ? or [..]; there are {names([s.name for s in sessions], 12)}."
            )
        return [s for s in sessions if s not in judging], judging
    if len(sessions) == 1:
        raise SerpentError(
            f"one session of {listed(config.logs)} is given, and a trace needs two: one judges what is "
            "fitted to the other. Record another one, three more are good; `serpent-twin check` says what "
            "this one can tell."
        )
    if len(sessions) <= config.held_out:
        raise SerpentError(
            f"--held-out {config.held_out} leaves none of {counted(len(sessions), 'session')} to be fitted. "
            f"Hold out {len(sessions) - 1} at most, or give more sessions."
        )
    return list(sessions[: -config.held_out]), list(sessions[-config.held_out :])


def _apart(
    config: Trace, sessions: Sequence[Log], held_out: Sequence[Path]
) -> tuple[list[Log], list[Log]]:
    """The other sessions, and those of some files or folders."""
    judging = [s for s in sessions if s.path and _lies_in(s.path, held_out)]
    training = [s for s in sessions if s not in judging]
    if not judging or not training:
        raise SerpentError(
            f"--held-out {listed(held_out)} names {len(judging)} of the {counted(len(sessions), 'session')} "
            f"in all: some must judge and some be fitted. Name others."
        )
    return training[: config.sessions or None], judging


def _lies_in(path: Path, sources: Sequence[Path]) -> bool:
    """Whether a file or folder is one of some, or a file in one."""
    every, path = {each.resolve() for each in sources}, path.resolve()
    return path in every or (path.is_file() and not every.isdisjoint(path.parents))


def trace_sessions(
    config: Trace, rig: machines.Rig, training: Sequence[Log], judging: Sequence[Log]
) -> tuple[Diagnosis, dict[str, Any]]:
    """Trace sessions that are split already; returns besides what diagnosis.json holds."""
    for each in notes_on([*training, *judging]):
        print(each)
    refuse_repeated([*training, *judging])
    settings = _settings(config, rig, training, judging)
    with claimed(config.out, SETTINGS, settings):
        began = time.perf_counter()
        tracer, selection, found = run(config, rig, training, judging, shown=True)
        seconds = tracer.notes.seconds + time.perf_counter() - began
        numbers = found.numbers(seconds, tracer.notes.simulated + tracer.case.clock.seconds)
        if config.twins:
            _write_twins(config, selection, tracer.training, found.arm, settings)
        return found, _write(config, tracer, found, numbers, settings)


def _settings(
    config: Trace, rig: machines.Rig, training: Sequence[Log], judging: Sequence[Log]
) -> dict[str, Any]:
    inputs = {s.name: file_hash(s.path) for s in [*training, *judging] if s.path}
    kept = {"rig": config.named, "held_out": config.held_out, "seed": config.seed}
    if not config.discover:
        kept["discover"] = False
    if config.judge or not isinstance(config.held_out, int) or len(config.logs) > 1:
        kept["held_out"] = [s.name for s in judging]
    if files := machines.made_of(rig):
        kept["machine_sha256"] = files
    if notes := notes_on([*training, *judging]):
        kept["reading_notes"] = notes
    return kept | {"input_sha256": inputs, "versions": versions()}


def run(
    config: Trace,
    rig: machines.Rig,
    training: Sequence[Log],
    judging: Sequence[Log],
    shown: bool = False,
) -> tuple[Tracer, Selection, Diagnosis]:
    """Trace sessions with checkpoints in OUT; a first picture is written there if it is to be `shown`."""
    arm = str(training[0].metadata.get("arm", config.logs[0].name))
    with Progress("first guesses") as progress:
        case = rig.open(training)
        progress.simulations = lambda: case.clock.count
        before = case.compare(None, case.pieces([*training, *judging]))
        if shown:
            progress.say(begin_report(before, config.out, f"What the twin of {arm} lacks"))
        notes = Checkpoints(config.out / "stages", case.clock)
        case = guessed(case, training, progress.step, notes.numbers)
        kind = ComposingTracer if config.discover and case.composes else RefittingTracer
        tracer = kind(
            case,
            case.pieces(training),
            case.pieces(judging),
            notes,
            progress.step,
            config.seed,
            60 * config.minutes,
            in_rows(rig.in_rows(case, training), training, notes, progress.step),
        )
        selection = tracer.select()
        progress.step("what is left")
        found = build_diagnosis(tracer, selection, arm, [_file(s) for s in judging])
        found = replace(found, shown=before)
    return tracer, selection, found


def _file(session: Log) -> str:
    """A session's file, or the name of what is part of one."""
    path = session.path
    return path.name if path and path.stem == session.name else session.name


def _write(
    config: Trace,
    tracer: Tracer,
    found: Diagnosis,
    numbers: dict[str, Any],
    settings: Mapping[str, Any],
) -> dict[str, Any]:
    origin = dict(settings) | provenance()
    logs = [_seen_from(config.out, each) for each in config.sources]
    numbers = numbers | {"provenance": origin | {"logs": logs}}
    assert tracer.final is not None
    about = {"arm": found.arm, "provenance": origin}
    tracer.case.write(tracer.final, config.out / "twin.json", about)
    keep(config.out, bool(numbers["effects"]))
    if found.learned.on:
        found.learned.save(config.out / "learned.npz")
    facts = {
        "logs": listed(config.logs),
        "seed": str(config.seed),
        "commit": str(origin["git_commit"]),
        "versions": versions_text(origin),
    }
    if notes := settings.get("reading_notes"):
        facts["read"] = " ".join(notes)
    if note := first_comment(config.out / "twin.xml"):
        facts["twin.xml"] = note
    priors = {each.name: each.prior for each in tracer.case.declared}
    report = write(
        page(found, facts, tracer.case.candidates, priors, tracer.case.track_record), config.out
    )
    numbers = finite(numbers)
    write_json(config.out / "diagnosis.json", numbers)
    print("\n".join(tracer.case.notes))
    print(f"\n{summary(found, tracer.case.candidates)}\n")
    share = 100 * numbers["share_of_time_in_simulation"]
    print(f"{numbers['seconds']:.0f} s, {share:.0f} % of it in simulation.")
    print(f"{report}: the figures. {config.out / 'twin.json'}: the corrected twin.")
    return numbers


def _seen_from(out: Path, logs: Path) -> str:
    """Path of logs, relative to the results if both lie in the working folder; else absolute."""
    here = Path.cwd()
    out, logs = out.resolve(), logs.resolve()
    if out.is_relative_to(here) and logs.is_relative_to(here):
        return Path(os.path.relpath(logs, out)).as_posix()
    return str(logs)


def _write_twins(
    config: Trace, selection: Selection, training: Any, arm: str, settings: Mapping[str, Any]
) -> None:
    """Write the calibrated twin, and those that the logs cannot distinguish from the corrected one."""
    folder, rng = config.out / "twins", np.random.default_rng([config.seed, 11])
    folder.mkdir(exist_ok=True)
    about = {"arm": arm, "provenance": dict(settings) | provenance()}
    selection.case.write(selection.calibrated.point, folder / "calibrated.json", about)
    points = drawn(selection.case, selection.final, training, rng, config.twins)
    for n, point in enumerate(points, 1):
        selection.case.write(point, folder / f"drawn_{n:02d}.json", about)
