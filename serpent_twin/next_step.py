"""Suggest the next command when a command has ended.

A row of `STEPS`, a command of README's path, is filled with the paths of the run that has ended. Nothing is
tried here: the tests parse every row as its command does.
"""

import os
import shlex
import sys
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from serpent_twin.command_line.program import as_started
from serpent_twin.runs.files import unused

if TYPE_CHECKING:
    from serpent_twin.identification import Trace

Words = list[str]
"""A module and its arguments"""
STEPS = {
    "check": "check --machine {machine} --logs {logs}",
    "collect": "collect {changed} --twin {twin} --rate-hz {rate} --out {out}",
    "estimate": "estimate --model {model} --rate-hz {rate} --out {out}",
    "examine": "bus.doctor --port {port} --setup {setup}",
    "export": "export {twin} --to mjcf --out {out}",
    "first run": "collect --backend real --port {port} --setup {setup} {changed} --frame {frame} "
    "--out {out} --sessions 1 --steps 40",
    "follow": "collect --backend real --motion {motion} --arm {arm} --sessions 2 --rate-hz {rate} "
    "--out {out}",
    "look": "log info {path}",
    "replay": "replay {session} --readout {readout} --twin {twin} --out {out}",
    "set up": "bus.doctor --help",
    "trace": "trace --logs {logs} --rig {rig} --machine {machine} --out {out}",
    "train": "train --logs {logs} --twin {twin} --out {out}",
}
"""Commands by what they do; an option whose value is not given is left out"""
RATE_HZ = 4.0
"""Control steps per second of commands that are given none"""
TO_TRAIN = 3
"""Sessions that training splits: to fit, to choose a model by, to test"""


def step(name: str, **given: Any) -> Words:
    """The command of a row of `STEPS`, its output at a path where nothing is."""
    if isinstance(given.get("rate"), float):
        given["rate"] = None if given["rate"] == RATE_HZ else f"{given['rate']:g}"
    if "out" in given:
        given["out"] = unused(given["out"])
    verb, *words = STEPS[name].split()
    found = [f"serpent_twin.{verb}"]
    for word in words:
        value = given.get(word.strip("{}")) if word.startswith("{") else word
        if value:
            found += map(str, value if isinstance(value, tuple | list) else [value])
        elif found[-1].startswith("--"):
            found.pop()
    return found


def say(words: Words | None) -> None:
    """Print the next step as the last line of a command, if there is one."""
    if words:
        print(line(words))


def line(words: Words) -> str:
    """The line that `say` prints."""
    return f"next: {typed(words)}"


def typed(words: Words) -> str:
    """A step as typed in a shell."""
    return as_started(shlex.join(["python", "-m", *words]))


def after_logs(folder: Path, beside: Path) -> Words | None:
    """Next step after session logs were written or looked at: train on them; on too few, replay one."""
    from serpent_twin.sessions import session_files

    files = session_files(folder)
    if len(files) < TO_TRAIN:
        return replay(files[0], beside) if files else None
    out = named_after(beside, folder, "logs", "readouts")
    return step("train", logs=folder, twin=_twin_file(files[0]), out=out)


def after_trace(config: "Trace") -> Words | None:
    """Next step after a trace of the arm: collect from the corrected twin, at the logs' rate. After one of
    another machine: take the corrected twin to any MuJoCo program.
    """
    from serpent_twin.sessions import read_session, session_files

    out, twin = config.out, config.out / "twin.json"
    if config.machine:
        return step("export", twin=twin, out=out / "robot_twin.xml")
    if config.named != "arm" or not twin.is_file():
        return None
    rate = read_session(session_files(config.logs[0])[0]).rate_hz
    corrected = named_after(out.parent, out, "trace", "corrected")
    return step("collect", twin=twin, rate=rate, out=corrected)


def replay(
    session: Path, beside: Path, readout: Path | None = None, twin: Path | None = None
) -> Words:
    """Replay a session, with a readout and the twin.json of a corrected twin that fit it."""
    name = f"{session.parent.name}_{session.stem}.rrd".lstrip("_")
    twin = twin if twin and twin.suffix == ".json" else None
    return step("replay", session=session, readout=readout, twin=twin, out=beside / name)


def after_replay(recording: Path) -> Words:
    """Next step after a recording was made: look at it; in a browser where there is no display."""
    shown = sys.platform != "linux" or {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys()
    return ["rerun", *([] if shown else ["--serve-web"]), str(recording)]


def named_after(beside: Path, of: Path, usual: str, wanted: str) -> Path:
    """Where to write `wanted`: called after what it is made of, unless that has its usual name."""
    name = of.resolve().name
    return beside / (wanted if name == usual else f"{name}_{wanted}")


def changed(chosen: Any, usual: Any) -> Words:
    """The options that differ from their defaults."""
    words: Words = []
    for field in fields(chosen):
        value, flag = getattr(chosen, field.name), f"--{field.name.replace('_', '-')}"
        if value != getattr(usual, field.name):
            values = value if isinstance(value, tuple) else () if value is True else (value,)
            words += [flag, *map(str, values)]
    return words


def _twin_file(session: Path) -> Path | None:
    """The twin.json that a session was collected from, if it is still there."""
    from serpent_twin.runs.provenance import file_hash
    from serpent_twin.sessions import read_session

    twin = read_session(session).metadata.get("twin")
    if not isinstance(twin, dict):
        return None
    path = Path(str(twin.get("path")))
    there = path.suffix == ".json" and path.is_file()
    return path if there and file_hash(path) == twin.get("sha256") else None
