"""Train the readouts, and score them on test sessions."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill
from typing import Annotated, Any

import numpy as np
from tqdm import tqdm

from serpent_twin import stored
from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import GIVEN, Checked, Seed, Use, when
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import available, find
from serpent_twin.extras import require
from serpent_twin.runs.files import write_json
from serpent_twin.runs.provenance import file_hash, provenance
from serpent_twin.runs.report import text_table, write
from serpent_twin.runs.run_lock import claimed, prior_settings
from serpent_twin.sessions import read_folder
from serpent_twin.sim import twin_model
from serpent_twin.stored import within
from serpent_twin.training import adapt as adapting
from serpent_twin.training.jitter import command_error, jittered
from serpent_twin.training.known_twin import KnownTwin, known_twin
from serpent_twin.training.page import page
from serpent_twin.training.split import Split, refuse_unseen, split
from serpent_twin.training.tables import adapt_table, detail_table, score_table
from serpent_twin.training.training_run import COST, Result, TrainingRun, summaries
from serpent_twin.training.uncertainty import METHOD

SETTINGS = "train.json"
JITTER = "command_jitter_rad_s"
WINDOW_MOST = 1000
"""Rows of the longest window: of 40,000 such windows each layer's inputs fill some 8 GB."""
SWEPT = ("linear", "mlp")
"""The readouts whose window --windows varies."""
_SPLIT, _WINDOW, _FIT, _ADAPT = map(Group, ("session split", "window", "training", "adaptation"))


def _without_twin(config: "Train") -> str:
    return _none_with("twin", config, "the twin of readouts that have one")


def _without_networks(config: "Train") -> str:
    return _none_with("epochs", config, "for networks")


def _none_with(setting: str, config: "Train", what: str) -> str:
    """Why an option is ignored by readouts none of which has a setting; empty if one has it.

    A run that continues in a folder takes the options of the folder's run.
    """
    trained = {*config.readout, *(SWEPT if config.windows else ())}
    wanted = [n for n, kind in available().items() if kind.trained.takes(setting)]
    if not config.readout or trained.intersection(wanted) or prior_settings(config.out, SETTINGS):
        return ""
    return (
        f"is {what}, and this run trains none: leave it out, or add one to --readout: "
        f"{', '.join(wanted)}."
    )


@dataclass(frozen=True)
class Train(Checked):
    """Train pose readouts on session logs, score them on sessions they never saw, and report.

    OUT gets scores.json, report.html, report.md, figures and the trained readouts (models/NAME). After an
    interruption, the same command continues with the readouts that are missing; further readouts can be added
    to a finished one.
    """

    logs: Path
    """Folder with the session logs."""
    out: Path
    """Folder for results; made if it does not exist."""
    readout: tuple[str, ...] = ()
    """Names of readouts; by default all there are. Of those that have a twin, the observer is trained where
    the twin is known, by --twin or because it made the logs, and the others with --twin."""
    window: Annotated[int, within(1, WINDOW_MOST), _WINDOW] = 4
    """Rows of the log that a readout sees at a time, H; the published one is 4."""
    windows: Annotated[str, _WINDOW] = ""
    """Also compare windows, such as 1..8 or 1,2,4: trains linear and mlp for each."""
    test: Annotated[tuple[str, ...], _SPLIT] = ()
    """Names of the test sessions; by default the last one."""
    validate: Annotated[tuple[str, ...], _SPLIT] = ()
    """Names of the validation sessions; by default the two before it, or one if there are fewer than six
    sessions."""
    twin: Annotated[Path | None, Use(_without_twin)] = None
    """A twin.json of python -m serpent_twin.trace, for readouts that have a twin; by default the twin that
    made the logs, or the nominal one."""
    drop: Annotated[int, within(0, 10_000_000), _SPLIT] = 100
    """First rows of each session that are not estimated; published: 100."""
    seed: Annotated[Seed, _FIT] = 0
    """Seed of first weights and batches."""
    epochs: Annotated[int | None, within(1, 1_000_000), _FIT, Use(_without_networks)] = None
    """Passes over the training windows at most, for a quick look; by default each readout's own."""
    threads: Annotated[int, within(1, 1024), _FIT] = 2
    """Threads of torch; the last digits of the results depend on it."""
    adapt: Annotated[Path | None, _ADAPT] = None
    """Folder with the session logs of another arm: readouts trained on --logs are corrected by its first
    windows and scored on its last session. --test and --validate then name its sessions."""
    adapt_windows: Annotated[str, _ADAPT, when(adapt=GIVEN)] = adapting.ALL
    """Numbers of its windows to correct by, such as 0,100,500,all; 0 scores the readouts as they are."""
    command_jitter: Annotated[float | None, within(0.0, 100.0, "rad/s"), _ADAPT] = None
    """Train as if commands were off by normal errors of this size [rad/s]: simulated servos are not the
    arm's. By default the error of the servos of --adapt against their commands, else 0."""


@dataclass(frozen=True, eq=False)
class TrainingPlan:
    """A config with its sessions, readouts and windows, checked."""

    config: Train
    """The config, its command jitter known"""
    sessions: Split
    """The logs to train on"""
    wanted: list[tuple[str, int]]
    """Readouts and windows"""
    twin: KnownTwin
    """Twin of the readouts that have one"""
    adaptation: adapting.Adaptation | None
    """Another arm to adapt to"""


def train(config: Train) -> dict[str, Any]:
    """Train and score the readouts of a config; returns what scores.json holds."""
    return carried_out(planned(config))


def carried_out(plan: TrainingPlan) -> dict[str, Any]:
    """Train and score what was planned; returns what scores.json holds."""
    config, sessions, real = plan.config, plan.sessions, plan.adaptation
    with claimed(config.out, SETTINGS, settings(config, sessions)):
        wanted = list(dict.fromkeys(plan.wanted + _trained_before(config)))
        if _train_networks(wanted):
            _set_threads(config.threads)
        results = _run([_training_run(plan, *one) for one in wanted], sessions, config)
        models = [each.name for each in results if each.window == config.window]
        adapted = adapting.adapt(real, models, config.out) if real else None
        return _conclude(plan, results, adapted or adapting.earlier(config.out))


def planned(config: Train) -> TrainingPlan:
    """The plan of a config; what cannot be done is refused before a folder is locked."""
    for name in config.readout:
        find(name)
    adaptation = _adaptation(config)
    asked = ((), ()) if adaptation else (config.validate, config.test)
    sessions = split(read_folder(config.logs), *asked)
    if adaptation:
        adaptation.refuse(sessions)
    twin = known_twin(sessions, config.twin)
    names = list(config.readout) or twin.readouts()
    swept = [(name, h) for name in SWEPT for h in parse_windows(config.windows)]
    wanted = list(dict.fromkeys([(name, config.window) for name in names] + swept))
    if _train_networks(wanted):
        require("torch", "learn", "Training a network", ", or name other readouts: --readout")
    for window in {h for _, h in wanted}:
        refuse_unseen(*sessions.windows(window, config.drop))
    if config.command_jitter is None:
        config = replace(config, command_jitter=_servo_error(adaptation, config.out))
    return TrainingPlan(config, sessions, wanted, twin, adaptation)


def _adaptation(config: Train) -> adapting.Adaptation | None:
    if config.adapt is None:
        return None
    how = config.adapt_windows, config.window, config.drop
    return adapting.read(config.adapt, *how, config.validate, config.test)


def _servo_error(plan: adapting.Adaptation | None, out: Path) -> float:
    """Velocity error of the arm's servos [rad/s]; without an arm, that of an earlier run."""
    if plan is None:
        where = str(out / SETTINGS)
        return stored.take(prior_settings(out, SETTINGS), _Kept, where).command_jitter_rad_s
    return round(command_error(plan.learn), 4) if plan.window > 1 else 0.0


class _Kept(stored.OpenForm, frozen=True):
    """The settings that a continued run keeps."""

    command_jitter_rad_s: Annotated[float, stored.within(0.0, 100.0, "rad/s")] = 0.0


def _trained_before(config: Train) -> list[tuple[str, int]]:
    """Readouts and windows that an earlier run completed in the folder: they stay in the report."""
    kept = {config.window: config.out / "models"}
    kept |= {int(p.name): p for p in (config.out / "windows").glob("[0-9]*")}
    return [
        (path.parent.name, window)
        for window, folder in sorted(kept.items())
        for path in sorted(folder.glob(f"*/{COST}"))
        if path.parent.name in available()
    ]


def parse_windows(text: str) -> list[int]:
    """Window lengths out of `1..8` or `1,2,4`; none out of an empty text."""
    if not text:
        return []
    if any(len(word) > len(str(WINDOW_MOST)) for word in re.findall(r"\d+", text)):
        raise SerpentError(f"--windows {text}: a window has at most {WINDOW_MOST} rows.")
    windows: list[int] = []
    if found := re.fullmatch(r"(\d+)\.\.(\d+)", text):
        windows = list(range(int(found[1]), int(found[2]) + 1))
    elif re.fullmatch(r"\d+(,\d+)*", text):
        windows = [int(word) for word in text.split(",")]
    if not windows or min(windows) < 1:
        raise SerpentError(f"--windows {text} names no windows; write 1..8 or 1,2,4.")
    return windows


def settings(config: Train, sessions: Split) -> dict[str, Any]:
    """The settings that runs in one folder must share."""
    kept = {key: getattr(config, key) for key in ("window", "drop", "seed", "epochs", "threads")}
    inputs = {s.name: file_hash(s.path) for s in sessions.all() if s.path}
    if config.command_jitter:
        kept[JITTER] = config.command_jitter
    if config.twin:
        kept["twin_sha256"] = file_hash(config.twin)
    return kept | {"sessions": sessions.names(), "input_sha256": inputs}


def _train_networks(wanted: list[tuple[str, int]]) -> bool:
    return any(find(name).trained.takes("epochs") for name, _ in wanted)


def _set_threads(threads: int) -> None:
    import torch

    torch.set_num_threads(threads)


def _training_run(plan: TrainingPlan, name: str, window: int) -> TrainingRun:
    config = plan.config
    place = "models" if window == config.window else f"windows/{window}"
    twin = twin_model.to_dict(plan.twin.design) if plan.twin.design else None
    return TrainingRun(name, window, config.out / place / name, config.seed, config.epochs, twin)


def _run(runs: list[TrainingRun], sessions: Split, config: Train) -> dict[TrainingRun, Result]:
    """Train what is not stored yet, then score everything."""
    missing = [each for each in runs if not each.stored()]
    for number, each in enumerate(missing, 1):
        *known, test = sessions.windows(each.window, config.drop)
        learn, steer = (
            jittered(part, config.command_jitter or 0.0, np.random.default_rng([config.seed, n]))
            for n, part in enumerate(known)
        )
        label = f"[{number}/{len(missing)}] {each.name}, H = {each.window}"
        with tqdm(desc=label, unit="epoch", leave=True) as bar:
            each.train(learn, steer, lambda *told, bar=bar: _show(bar, *told), test)
    tested = {h: sessions.windows(h, config.drop)[2] for h in {each.window for each in runs}}
    return {each: each.result(tested[each.window]) for each in runs}


def _show(bar: tqdm, done: int, most: int, loss: float) -> None:
    bar.total = most
    if np.isfinite(loss):
        bar.set_postfix_str(f"validation loss {loss:.3g}", refresh=False)
    bar.update(done - bar.n)


def _conclude(
    plan: TrainingPlan, results: dict[TrainingRun, Result], real: dict[str, Any] | None
) -> dict[str, Any]:
    """Write scores.json and the report, print the table; returns what scores.json holds."""
    config, sessions = plan.config, plan.sessions
    table = {t.name: r for t, r in results.items() if t.window == config.window}
    asked, by_window = parse_windows(config.windows), dict[str, dict[str, Any]]()
    for t, result in results.items():
        if t.name in SWEPT and (t.window != config.window or t.window in asked):
            by_window.setdefault(t.name, {})[str(t.window)] = result.summary()
    scores: dict[str, Any] = {
        "logs": str(config.logs),
        "test_sessions": sessions.names()["test"],
        "window": config.window,
        "readouts": summaries(table),
        "windows": by_window,
        "intervals": METHOD,
        "note": plan.twin.note(list(table)),
        "provenance": settings(config, sessions) | provenance(),
    } | ({"adapt": real} if real else {})
    write_json(config.out / "scores.json", scores)
    tested = sessions.windows(config.window, config.drop)[2]
    report = write(page(scores, {n: r.error_mm for n, r in table.items()}, tested), config.out)
    for shown in (score_table(scores["readouts"]), detail_table(scores["readouts"])):
        print(f"{text_table(shown)}\n\n{fill(shown.note, 100)}\n")
    if scores["note"]:
        print(f"{fill(scores['note'], 100)}\n")
    if real:
        print(f"{text_table(adapt_table(real))}\n")
    print(f"The table took {sum(r.train_s for r in table.values()):.0f} s of training.")
    print(f"\n{report}: the figures. {config.out / 'models'}: the trained readouts.")
    return scores
