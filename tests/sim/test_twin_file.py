"""Test that the arm of a twin.json is the same in a collected run, on the bus, and behind a port."""

import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
from typed import typed

from serpent_twin.arm import mjcf
from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects import KNOWN
from serpent_twin.emulator.child import running
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.dynamixel.setup import ArmSetup, write_setup
from serpent_twin.hardware.xl430 import CENTRE, VELOCITY_UNIT
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect, RealArm
from serpent_twin.sessions import FIELDS, read_session
from serpent_twin.sim import arm_file, twin_model
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import TwinModel

QUIET = replace(NOMINAL, load_noise=0.0, marker_noise=0.0)
EFFECTS = (
    KNOWN["gear_backlash"](0.05),
    KNOWN["cable_creep"](0.5, time=10.0),
    KNOWN["link_flex"](0.05),
    KNOWN["mocap_latency"](0.05),
)
ARM = TwinModel(QUIET, Deviations(strand_stiffness=tuple(np.linspace(-0.2, 0.2, 20))), EFFECTS)
SHORT = {"sessions": 1, "steps": 24}


def written(folder, arm=ARM, name="twin.json"):
    folder.mkdir(parents=True, exist_ok=True)
    twin_model.write(folder / name, arm, {"arm": "made for a test"})
    return folder / name


def command(*arguments):
    return typed("serpent_twin.collect", *arguments)


def same(a, b):
    return all(np.array_equal(getattr(a, n), getattr(b, n), equal_nan=True) for n in FIELDS)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A folder with a twin.json, and the session that the command collects of it."""
    folder = tmp_path_factory.mktemp("made")
    twin = written(folder)
    done = command("--out", folder / "logs", "--twin", twin, "--sessions", 1, "--steps", 24)
    assert done.returncode == 0, done.stderr
    return folder, read_session(folder / "logs" / "session_01.parquet")


def test_a_run_is_of_the_file_s_arm_and_comes_out_the_same_again(logs, tmp_path):
    folder, session = logs
    (again,) = collect(Collect(tmp_path / "again", twin=folder / "twin.json", **SHORT))
    (nominal,) = collect(Collect(tmp_path / "nominal", parameters=QUIET, **SHORT))
    assert same(session, read_session(again))
    assert np.array_equal(session.joint_target, read_session(nominal).joint_target)
    off = np.linalg.norm(session.marker - read_session(nominal).marker, axis=-1)
    assert off[8:].mean() > 2e-3


def test_a_log_says_which_arm_it_is_of(logs):
    folder, session = logs
    about = session.metadata
    assert about["config"]["model_sha256"] == ARM.fingerprint()
    assert about["config"]["parameters"]["load_noise"] == 0.0
    assert about["twin"]["path"] == str(folder / "twin.json") and len(about["twin"]["sha256"]) == 64


def test_another_arm_does_not_mix_with_a_run(logs, tmp_path):
    folder, _ = logs
    other = written(tmp_path, ARM.with_effect(KNOWN["gear_backlash"](0.06)))
    with pytest.raises(SerpentError, match=r"model_sha256 was .* another --out"):
        collect(Collect(folder / "logs", twin=other, **SHORT))


def test_the_bus_moves_the_design_s_twin():
    twin, bus = Twin(ARM), SimulatedBus(Twin(ARM), np.random.default_rng(0))
    with bus:
        bus.enable_torque()
        for goal in np.random.default_rng(1).integers(-20, 21, (8, 10)):
            bus.motors.goal = goal
            bus.wait(0.25)
            twin.advance(goal * VELOCITY_UNIT, 0.25)
            for name in ("motor_angle", "motor_torque", "joint_angle", "markers", "tension"):
                assert np.array_equal(getattr(bus.twin, name), getattr(twin, name)), name


def test_over_the_wire_a_session_has_the_rows_of_the_file_s_arm(logs, tmp_path):
    """Behind a port and in process, in float64; the device has no cameras in lockstep."""
    folder, session = logs
    with running("--lockstep", "--model", str(folder / "twin.json")) as device:
        setup = tmp_path / "arm.toml"
        write_setup(ArmSetup(device.port, zero=(CENTRE,) * 10, path=setup))
        real = RealArm(setup=setup)
        (wire,) = collect(Collect(tmp_path / "real", backend="real", real=real, **SHORT))
    there = read_session(wire)
    for name in ("motor_position", "motor_velocity", "motor_load", "motor_velocity_command"):
        assert np.array_equal(getattr(session, name), getattr(there, name)), name


def test_mjcf_is_the_arm_without_what_mjcf_cannot_say(logs, tmp_path):
    """The file's numbers have six digits; what acts in Python is left out, and said."""
    folder, _ = logs
    done = command("--out", tmp_path / "xml", "--twin", folder / "twin.xml", "--sessions", 1,
                   "--steps", 24, "--load-noise", 0, "--marker-noise", 0)  # fmt: skip
    assert "lacks the effects that only twin.json can hold" in done.stdout
    static = replace(ARM, effects=tuple(e for e in EFFECTS if not e.acts()))
    (json,) = collect(Collect(tmp_path / "json", twin=written(tmp_path, static), **SHORT))
    a, b = read_session(tmp_path / "xml" / "session_01.parquet"), read_session(json)
    assert np.linalg.norm(a.marker - b.marker, axis=-1).mean() < 2e-4
    assert a.metadata["config"]["model_sha256"] != b.metadata["config"]["model_sha256"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameters": replace(NOMINAL, load_noise=0.1)}, "leave out --load-noise"),
        ({"backend": "real"}, "--twin is for --backend sim"),
    ],
)
def test_what_excludes_the_file_is_said(logs, tmp_path, change, message):
    with pytest.raises(SerpentError, match=message):
        collect(Collect(tmp_path / "logs", twin=logs[0] / "twin.json", **SHORT, **change))
    assert not (tmp_path / "logs").exists()


def test_a_file_that_is_no_arm_is_refused(tmp_path):
    (tmp_path / "twin.json").write_text("{}")
    (tmp_path / "empty.xml").write_text("")
    (tmp_path / "one.xml").write_text("<mujoco/>")
    text = mjcf.build().to_xml()
    (tmp_path / "slide.xml").write_text(text.replace('name="joint1"', 'name="joint1" type="slide"'))
    for name, message in (
        ("twin.json", r"twin\.json: it lacks kind, parameters, tolerances"),
        ("gone.json", r"gone\.json cannot be read"),
        ("gone.xml", "there is no such file"),
        (
            "empty.xml",
            r"no model that MuJoCo can load: .*\. Give a twin\.json or a model in MJCF\.$",
        ),
        ("one.xml", "actuators must be motor1, motor2, .* missing or elsewhere: motor1"),
        ("slide.xml", "joints that are no hinges"),
    ):
        with pytest.raises(SerpentError, match=message):
            arm_file.read(tmp_path / name)


def test_the_hash_of_an_arm_in_mjcf_is_of_its_physics_not_of_a_file(tmp_path):
    """Parts in included files and meshes count, the folder does not."""
    head = '<body name="base"'
    here, there = tmp_path / "here", tmp_path / "there" / "deeper"
    mjcf.write(here)
    whole = (here / "serpent.xml").read_text()
    bodies = whole[whole.index("<tendon>") : whole.index("</tendon>") + len("</tendon>")]
    assert head in whole
    (here / "cables.xml").write_text(f"<mujoco>{bodies}</mujoco>")
    (here / "arm.xml").write_text(whole.replace(bodies, '<include file="cables.xml"/>'))
    shutil.copytree(here, there)

    def prints(folder, name="arm.xml"):
        return arm_file.read(folder / name).fingerprint

    before = prints(here)
    assert prints(there) == before == prints(here, "serpent.xml") == prints(here)
    (there / "cables.xml").write_text(
        (there / "cables.xml").read_text().replace("0.02", "0.021", 1)
    )
    mesh = here / "assets" / "link1_body.stl"
    mesh.write_bytes(_moved(mesh.read_bytes()))
    os.utime(mesh, (0, 0))  # MuJoCo remembers a mesh by its second
    assert len({before, prints(there), prints(here)}) == 3


def _moved(stl):
    """A mesh with one corner elsewhere: of each triangle, a normal and three corners in float32."""
    corners = np.frombuffer(stl[84 + 12 : 84 + 24], np.float32) + np.float32(1e-3)
    return stl[: 84 + 12] + corners.tobytes() + stl[84 + 24 :]
