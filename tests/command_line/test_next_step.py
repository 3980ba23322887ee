"""Test that each command ends with a step that can be typed as it stands."""

import functools
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from learning_sessions import make_session
from readme import ROOT, options, small
from trainings import write
from typed import typed

from serpent_twin import mocap, next_step, sweep, train
from serpent_twin.command_line import cli
from serpent_twin.effects.payload import Payload
from serpent_twin.emulator.child import running
from serpent_twin.identification.run import Trace, planned
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import read_folder, read_session, write_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN
from serpent_twin.training.train import Train
from serpent_twin.training.train import planned as trained

CAMERAS = ["--mocap", "natnet", "--labels", *"abcdefghi"]
FILLED = [
    ("check", {"machine": "robot", "logs": ("a.csv", "b.csv")}),
    ("collect", {"twin": "trace/twin.json", "rate": 20.0, "out": "corrected"}),
    ("collect", {"changed": ["--strand-stiffness", "8000.0"], "out": "softest"}),
    ("estimate", {"model": "out/models/mlp", "rate": 20.0, "out": "live"}),
    ("examine", {"port": "/dev/x", "setup": "sim.toml"}),
    ("export", {"twin": "trace/twin.json", "out": "robot_twin.xml"}),
    ("first run", {"port": "/dev/x", "setup": "sim.toml", "out": "first_run"}),
    ("first run", {"changed": CAMERAS, "frame": "frame.json", "out": "first_run"}),
    ("follow", {"motion": "m.parquet", "arm": "a", "rate": 20.0, "out": "next_logs"}),
    ("look", {"path": "logs"}),
    ("replay", {"session": "a.parquet", "out": "a.rrd"}),
    ("replay", {"session": "a.parquet", "readout": "mlp", "twin": "twin.json", "out": "a.rrd"}),
    ("set up", {}),
    ("trace", {"logs": "logs", "rig": "arm", "out": "trace"}),
    ("trace", {"logs": ("a", "b"), "machine": "robot", "out": "trace"}),
    ("train", {"logs": "logs", "out": "readouts"}),
    ("train", {"logs": "logs", "twin": "trace/twin.json", "out": "readouts"}),
]
QUICK = "--readout linear mlp observer"


def test_each_row_is_filled_at_least_once_with_all_that_it_takes():
    for name, row in next_step.STEPS.items():
        given = {key for filled, values in FILLED if filled == name for key in values}
        assert set(re.findall(r"{(\w+)}", row)) == given


@pytest.mark.parametrize(("name", "given"), FILLED)
def test_each_step_is_one_that_its_command_takes(name, given, monkeypatch):
    """Each command parses its words with its own options, and does no more."""
    parsed, real_run = [], cli.run

    def noted(main):
        @functools.wraps(main)
        def note(*words, **options):
            parsed.append((words, options))

        return note

    def parse(main, argv=None, error_status=1):
        mains = noted(main) if callable(main) else {n: noted(each) for n, each in main.items()}
        real_run(mains, argv, error_status)

    given = {key: Path(each) if key == "out" else each for key, each in given.items()}
    monkeypatch.setattr(cli, "run", parse)
    module, *words = next_step.step(name, **given)
    done = typed(module, *words)
    assert done.returncode == 0, done.stderr
    assert parsed or "--help" in words


def run(command: str, folder: Path) -> str:
    """What a command prints that is typed in a folder and must succeed."""
    done = typed(*shlex.split(command)[2:], folder=folder)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def after(printed: str) -> str:
    """The step that the last line names."""
    last = printed.rstrip().rpartition("\n")[2]
    assert last.startswith("next: python -m "), last
    return last.removeprefix("next: ")


def fewer(step: str, more: str = "") -> str:
    return shlex.join(["python", *small(step), *shlex.split(more)])


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """A folder whose name has a space, with logs of the twin in a further folder."""
    place = tmp_path_factory.mktemp("next") / "a place"
    collect(Collect(place / "my runs" / "logs", sessions=3, steps=170, workers=1))
    return place


@pytest.fixture(scope="module")
def few(tmp_path_factory) -> Path:
    """A folder with logs that are too few to train on."""
    folder = tmp_path_factory.mktemp("few")
    collect(Collect(folder / "few", sessions=1, steps=40, workers=1))
    return folder


@pytest.mark.slow
def test_logs_are_trained_on_and_then_traced(place):
    step = after(run("python -m serpent_twin.log check 'my runs/logs'", place))
    assert step == "python -m serpent_twin.train --logs 'my runs/logs' --out readouts"
    step = after(run(fewer(step, QUICK), place))
    assert step == "python -m serpent_twin.trace --logs 'my runs/logs' --out trace"
    asked = Trace((place / "my runs/logs",), place / "trace")
    assert [len(part) for part in planned(asked)[1:]] == [2, 1]
    step = after(run("python -m serpent_twin.log info 'my runs/logs'", place))
    assert step.endswith("--out readouts_2")  # the other one holds a run


@pytest.mark.slow
def test_a_corrected_twin_is_collected_from_trained_on_and_followed(place):
    twin = place / "trace" / "twin.json"
    twin.parent.mkdir()
    twin_model.write(twin, NOMINAL_TWIN.with_effect(Payload(mass=0.03)), {})
    step = next_step.after_trace(Trace((place / "my runs/logs",), Path("trace")))
    assert step is None  # there is no such twin from here
    step = next_step.after_trace(Trace((place / "my runs/logs",), place / "trace"))
    assert step == ["serpent_twin.collect", "--twin", str(twin), "--out", str(place / "corrected")]
    step = after(
        run(fewer("python -m serpent_twin.collect --twin trace/twin.json --out corrected"), place)
    )
    assert step.endswith("train --logs corrected --twin trace/twin.json --out corrected_readouts")
    step = after(run(fewer(step), place))
    assert step.endswith("estimate --model corrected_readouts/models/observer --out live")
    step = after(run(fewer(step), place))
    assert "--readout corrected_readouts/models/observer --out live_session_01.rrd" in step
    step = after(run(step, place))
    assert "rerun" in step and (place / shlex.split(step)[-1]).is_file()
    twin_model.write(twin, NOMINAL_TWIN, {})  # no longer the twin that was collected from
    assert "--twin" not in after(run("python -m serpent_twin.log info corrected", place))


def test_logs_too_few_to_train_on_are_replayed(few):
    for look in ("log info few", "log check few", "log info few/session_01.parquet"):
        step = after(run(f"python -m serpent_twin.{look}", few))
        assert (
            step == "python -m serpent_twin.replay few/session_01.parquet --out few_session_01.rrd"
        )
    run(step, few)


def test_damaged_logs_have_no_next_step(few, tmp_path):
    session = read_session(few / "few/session_01.parquet")
    session.motor_position[20, 3] = np.nan
    (tmp_path / "bad").mkdir()
    write_session(tmp_path / "bad" / "session_01.parquet", session)
    assert "next:" not in run("python -m serpent_twin.log info bad", tmp_path)


def test_without_a_twin_the_observer_is_told_how_it_is_had(tmp_path):
    (tmp_path / "arm_x").mkdir()
    for number in (1, 2, 3):
        write(tmp_path / "arm_x", make_session(number, rows=170))
    plan = trained(Train(tmp_path / "arm_x", tmp_path / "out"))
    told = train.without_observer(plan)
    steps = [f"python -m serpent_twin.{s}" for s in told.split("python -m serpent_twin.")[1:]]
    tracing, training = (options(shlex.split(step.removesuffix(", then "))) for step in steps)
    assert tracing["--logs"] == training["--logs"] == [str(tmp_path / "arm_x")]
    assert training["--twin"] == [f"{tracing['--out'][0]}/twin.json"]


def test_of_readouts_as_good_the_quickest_is_followed(tmp_path):
    each = {"a": (2.00, 18.0), "b": (2.05, 1.6), "c": (2.3, 0.1)}
    scores = {"readouts": {n: {"mean_mm": e, "latency_ms": t} for n, (e, t) in each.items()}}
    assert train.best_readout(tmp_path, scores).name == "b"
    scores["adapt"] = {
        "windows": {
            "a": {"0": {"mean_mm": 9.0, "latency_ms": 1}, "all": {"mean_mm": 1.0, "latency_ms": 1}}
        }
    }
    assert train.best_readout(tmp_path, scores) == tmp_path / "adapted" / "all" / "a"


def test_a_swept_arm_is_collected_from(tmp_path):
    arm = {"strand_stiffness": 8e3, "strand_slack": 3e-4, "joint_damping": 1e-3}
    softer = arm | {"strand_stiffness": 4e3}
    points = [
        {"arm": a, "failed": f, "point": {"command_rate_hz": 20.0}}
        for a, f in ((arm, []), (softer, ["body"]), ({"load_noise": 0.01}, []))
    ]
    step = sweep.after_sweep(tmp_path / "sweep", {"points": points})
    assert step
    step[-1] = "softest"
    found = options(step)
    assert found["--strand-stiffness"] == ["8000.0"] and found["--rate-hz"] == ["20"]
    run(fewer(f"python -m {shlex.join(step)}"), tmp_path)
    about = read_folder(tmp_path / "softest")[0].metadata["config"]["parameters"]
    assert about["strand_stiffness"] == 8000.0 and about["strand_slack"] == 3e-4
    assert sweep.after_sweep(tmp_path / "sweep", {"points": points[1:]}) is None


@pytest.mark.slow
def test_the_steps_from_the_device_to_its_log(tmp_path):
    words = [sys.executable, "-m", "serpent_twin.bus.device", "--lockstep", "--link", "./arm"]
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    device = subprocess.Popen(
        words,
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.PIPE,
        stdin=subprocess.PIPE,
        text=True,
    )
    try:
        assert device.stdout
        link, port, step = (device.stdout.readline().strip() for _ in range(3))
        assert (link, port.partition(" ")[0]) == ("link: arm", "port:")
        step = after(run(after(step), tmp_path))
        assert step.endswith("--port arm --setup sim.toml --out first_run --sessions 1 --steps 40")
        run(after(run(step, tmp_path)), tmp_path)  # collects, then replays what it has
        assert (tmp_path / "first_run_session_01.rrd").is_file()
        step = after(run("python -m serpent_twin.bus.zero --port arm --setup sim.toml", tmp_path))
        assert step.endswith("--setup sim.toml --out first_run_2 --sessions 1 --steps 40")
        run(step, tmp_path)
    finally:
        device.terminate()
        device.communicate()


def test_a_frame_is_used_by_a_run_that_can_begin(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    from serpent_twin.hardware.base_frame import IDENTITY
    from serpent_twin.hardware.dynamixel.setup import ArmSetup, write_setup
    from serpent_twin.hardware.natnet_live import NatNet
    from serpent_twin.hardware.xl430 import CENTRE

    there = NatNet(server="10.0.0.7", labels=tuple("abcdefghi"))
    step = mocap.after_frame(Path("base.json"), there)
    assert step == ["serpent_twin.bus.doctor", "--help"]  # no arm is set up here
    IDENTITY.save(Path("base.json"))
    with running("--lockstep") as device:
        write_setup(ArmSetup(device.port, zero=(CENTRE,) * 10, path=Path("arm.toml")))
        step = mocap.after_frame(Path("base.json"), there)
    assert options(step) == {
        "": ["serpent_twin.collect"],
        "--backend": ["real"],
        "--mocap": ["natnet"],
        "--server": ["10.0.0.7"],
        "--labels": list("abcdefghi"),
        "--frame": ["base.json"],
        "--out": ["first_run"],
        "--sessions": ["1"],
        "--steps": ["40"],
    }
