"""The loop closed on the independent arm; traces that go on, or leave what no candidate explains; and logs of
arms that cannot be traced. test_demo.py closes it on a robot's logs.
"""

import json
from dataclasses import replace
from pathlib import Path

import moving_models
import numpy as np
import pytest
from paths import DATA

from bench_arm import Job, draw, inject, record_many
from serpent_twin import machines
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.sessions import read_session, write_session
from serpent_twin.sim import twin_model

SESSIONS, STEPS = 2, 220
LAG = 0.03  # of the arm's servos [s]
TILT = 0.08  # [rad]


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A folder of sessions of an arm on a tilted base."""
    rng = np.random.default_rng([11, 1])
    arm = replace(draw(rng), marker_noise=2e-4, velocity_lag=LAG)
    folder = tmp_path_factory.mktemp("bench") / "arm_1"
    record_many([Job(folder, arm, inject("base_tilt", TILT, rng), 41, SESSIONS, STEPS)])
    return folder


def changed(folder: Path, to: Path, change) -> Path:
    """A folder with every session changed."""
    to.mkdir()
    for path in sorted(folder.glob("*.parquet")):
        write_session(to / path.name, change(read_session(path)))
    return to


@pytest.mark.slow
def test_a_tilted_base_is_named_with_its_angle(logs, tmp_path):
    out = tmp_path / "trace"
    found = trace(Trace((logs,), out, discover=False))
    assert [effect["name"] for effect in found["effects"]] == ["base_tilt"]
    tilt = found["effects"][0]
    about = [each["value"] for each in tilt["parameters"].values()]
    assert np.hypot(*about[:2]) == pytest.approx(TILT, rel=0.1)
    assert tilt["probability_of_chance"] < 0.01
    assert found["error_mm"]["corrected"] < 0.5 * found["error_mm"]["calibrated"]
    twin = twin_model.read(out / "twin.json")
    assert [type(effect).__name__ for effect in twin.effects] == ["BaseTilt"]
    assert twin.parameters.servo_lag == pytest.approx(LAG, abs=3e-3)
    assert "<mujoco" in (out / "twin.xml").read_text()
    assert (out / "report.html").stat().st_size > 100_000


@pytest.mark.slow
def test_what_no_candidate_explains_is_left_without_discovery_and_the_same_command_goes_on(
    tmp_path,
):
    """An elbow that meets a bumper, which a law at places would be."""
    path = moving_models.machine(tmp_path)
    path.write_text('candidates = ["gravity"]\n' + path.read_text())
    for n in range(2):
        moving_models.log(tmp_path / "logs" / f"session_{n}.csv", n, stop=1.2)
    config = Trace((tmp_path / "logs",), tmp_path / "out", machine=path, discover=False)
    found = trace(config)
    assert found["unexplained"]["is"] and found["unexplained"]["depends_on"]
    again = trace(config)
    for key in ("effects", "candidates", "error_deg", "unexplained"):
        assert json.dumps(again[key]) == json.dumps(found[key])


def test_one_session_is_too_few(logs, tmp_path):
    with pytest.raises(SerpentError, match=r"needs two: .*Record another"):
        trace(Trace((logs,), tmp_path / "out", sessions=1))


def test_an_unknown_rig_is_refused_with_what_there_is(logs, tmp_path):
    with pytest.raises(SerpentError, match=r"no rig 'leg'.*arm"):
        trace(Trace((logs,), tmp_path / "out", rig="leg"))


def test_logs_without_markers_are_refused(logs, tmp_path):
    blind = changed(
        logs,
        tmp_path / "blind",
        lambda s: s.having(marker=np.full_like(s.marker, np.nan)),
    )
    with pytest.raises(SerpentError, match="No marker was seen"):
        trace(Trace((blind,), tmp_path / "out"))


def test_logs_that_say_they_have_no_markers_are_refused(logs, tmp_path):
    def blind(session):
        metadata = {**session.metadata, "markers": "none"}
        return replace(
            session.having(marker=np.full_like(session.marker, np.nan)), metadata=metadata
        )

    with pytest.raises(SerpentError, match=r"no markers|No marker"):
        trace(Trace((changed(logs, tmp_path / "blind", blind),), tmp_path / "out"))


def test_logs_of_another_machine_are_refused(logs, tmp_path):
    foreign = changed(logs, tmp_path / "foreign", lambda s: s.having(marker=1.2 * s.marker))
    with pytest.raises(SerpentError, match=r"1\.(19|20)\d times as far apart"):
        trace(Trace((foreign,), tmp_path / "out"))


def test_two_arms_in_one_folder_are_refused(logs, tmp_path):
    def rename(session):
        odd = session.metadata["session"] % 2
        return replace(session, metadata={**session.metadata, "arm": f"arm_{odd}"})

    mixed = changed(logs, tmp_path / "mixed", rename)
    with pytest.raises(SerpentError, match="differ in arm"):
        trace(Trace((mixed,), tmp_path / "out"))


def test_logs_in_which_no_motor_moves_are_refused(logs, tmp_path):
    def still(session):
        first = np.repeat(session.motor_position[:1], len(session), 0)
        none = np.zeros_like(session.motor_velocity)
        return session.having(motor_position=first, motor_velocity=none)

    rig = machines.find("arm")
    with pytest.raises(SerpentError, match="no motor moves"):
        rig.open(rig.read(changed(logs, tmp_path / "still", still)))


def test_a_copy_with_markers_put_in_anew_is_refused(logs, tmp_path):
    copied = changed(logs, tmp_path / "copied", lambda session: session)
    again = read_session(logs / "session_01.parquet")
    write_session(copied / "session_03.parquet", again.having(marker=again.marker + 1e-4))
    with pytest.raises(SerpentError, match=r"session_01.parquet and .*session_03.parquet hold"):
        trace(Trace((copied,), tmp_path / "out"))


def test_a_machine_toml_of_the_arm_is_the_arm():
    """The arm is found by its name, and by the folder of its description."""
    assert machines.named("arm", Path("model")) == machines.named("arm", None) == "arm"
    rig, named = machines.find(str(Path("model/machine.toml").resolve())), machines.find("arm")
    assert type(rig) is type(named) and machines.made_of(rig) == machines.made_of(named)


def test_sessions_keep_what_their_recorder_says(tmp_path):
    """How long the arm ran before, and of which arm they are; in parts, where the clock pauses."""
    session = read_session(DATA / "arm_a" / "session_02.parquet")[:400]
    later = np.arange(len(session)) >= 200
    write_session(tmp_path / "session_02.parquet", session.having(time=session.time + 30.0 * later))
    logs = machines.find("arm").read(tmp_path)
    assert [log.name for log in logs] == ["session_02 part 1", "session_02 part 2"]
    assert {log.metadata["arm"] for log in logs} == {"arm_a"}
    began = read_session(tmp_path / "session_02.parquet").prior_runtime
    assert [log.prior_runtime for log in logs] == pytest.approx([began, began + 80.0], abs=0.3)
