"""The loop closed on the independent arm: an effect inside the catalogue, one outside it, none; and on logs
that cannot be traced. test_demo.py closes it on the committed logs.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paths import DATA

from bench_arm import NONE, Job, draw, inject, record_many
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.machines.arm import ArmRig
from serpent_twin.sessions import read_session, write_session
from serpent_twin.sim import twin_model

SESSIONS = 2
LAG = 0.03  # of the arms' servos [s]
ARMS = {"none": (0.0, 560), "base_tilt": (0.08, 220), "outside_force": (0.5, 560)}
"""Strengths, and control steps of each session"""


class Recorded(dict[str, Path]):
    """A folder of sessions for each arm, by its undeclared effect, recorded when it is asked for."""

    def __init__(self, root: Path) -> None:
        super().__init__()
        self.root = root

    def __missing__(self, name: str) -> Path:
        number, (strength, steps) = [*ARMS].index(name), ARMS[name]
        rng = np.random.default_rng([11, number])
        arm = replace(draw(rng), marker_noise=2e-4, velocity_lag=LAG)
        effects = inject(name, strength, rng) if strength else NONE
        job = Job(self.root / f"arm_{number}", arm, effects, 40 + number, SESSIONS, steps)
        record_many([job])
        self[name] = job.folder
        return job.folder


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return Recorded(tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="module")
def diagnosis(logs, tmp_path_factory):
    """Diagnoses by the name of the effect, each made once."""
    made: dict[str, tuple[dict, Path]] = {}

    def of(name: str) -> tuple[dict, Path]:
        if name not in made:
            out = tmp_path_factory.mktemp("trace") / name
            discover = name != "outside_force"
            made[name] = trace(Trace((logs[name],), out, discover=discover)), out
        return made[name]

    return of


def changed(folder: Path, to: Path, change) -> Path:
    """A folder with every session changed."""
    to.mkdir()
    for path in sorted(folder.glob("*.parquet")):
        write_session(to / path.name, change(read_session(path)))
    return to


@pytest.mark.slow
def test_an_arm_that_lacks_nothing_is_told_so(diagnosis):
    found, _ = diagnosis("none")
    assert found["effects"] == []
    assert not found["unexplained"]["is"]
    assert found["error_mm"]["calibrated"] < 0.3 * found["error_mm"]["nominal"]
    assert found["error_mm"]["corrected"] < 1.0


@pytest.mark.slow
def test_a_tilted_base_is_named_with_its_angle(diagnosis):
    found, out = diagnosis("base_tilt")
    assert [effect["name"] for effect in found["effects"]] == ["base_tilt"]
    tilt = found["effects"][0]
    about = [each["value"] for each in tilt["parameters"].values()]
    assert np.hypot(*about[:2]) == pytest.approx(ARMS["base_tilt"][0], rel=0.1)
    assert tilt["probability_of_chance"] < 0.01
    assert found["error_mm"]["corrected"] < 0.5 * found["error_mm"]["calibrated"]
    twin = twin_model.read(out / "twin.json")
    assert [type(effect).__name__ for effect in twin.effects] == ["BaseTilt"]
    assert twin.parameters.servo_lag == pytest.approx(LAG, abs=3e-3)
    assert "<mujoco" in (out / "twin.xml").read_text()
    assert (out / "report.html").stat().st_size > 100_000


@pytest.mark.slow
def test_what_the_catalogue_lacks_is_left_unexplained_without_discovery(diagnosis):
    found, _ = diagnosis("outside_force")
    assert found["unexplained"]["is"]
    assert found["unexplained"]["depends_on"]


@pytest.mark.slow
def test_the_same_command_goes_on_and_gives_the_same(diagnosis, logs):
    found, out = diagnosis("none")
    again = trace(Trace((logs["none"],), out))
    for key in ("effects", "candidates", "error_mm", "unexplained"):
        assert json.dumps(again[key]) == json.dumps(found[key])


def test_one_session_is_too_few(logs, tmp_path):
    with pytest.raises(SerpentError, match=r"needs two: .*Record another"):
        trace(Trace((logs["base_tilt"],), tmp_path / "out", sessions=1))


def test_an_unknown_rig_is_refused_with_what_there_is(logs, tmp_path):
    with pytest.raises(SerpentError, match=r"no rig 'leg'.*arm"):
        trace(Trace((logs["base_tilt"],), tmp_path / "out", rig="leg"))


def test_logs_without_markers_are_refused(logs, tmp_path):
    blind = changed(
        logs["base_tilt"],
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
        trace(Trace((changed(logs["base_tilt"], tmp_path / "blind", blind),), tmp_path / "out"))


def test_logs_of_another_machine_are_refused(logs, tmp_path):
    foreign = changed(
        logs["base_tilt"], tmp_path / "foreign", lambda s: s.having(marker=1.2 * s.marker)
    )
    with pytest.raises(SerpentError, match=r"1\.(19|20)\d times as far apart"):
        trace(Trace((foreign,), tmp_path / "out"))


def test_two_arms_in_one_folder_are_refused(logs, tmp_path):
    def rename(session):
        odd = session.metadata["session"] % 2
        return replace(session, metadata={**session.metadata, "arm": f"arm_{odd}"})

    mixed = changed(logs["base_tilt"], tmp_path / "mixed", rename)
    with pytest.raises(SerpentError, match="differ in arm"):
        trace(Trace((mixed,), tmp_path / "out"))


@pytest.mark.slow
def test_the_gripper_s_cable_pulls_where_its_jaw_is_held_and_only_there(logs):
    rig = ArmRig()
    held = rig.open(rig.read(DATA / "arm_a")[:1]).machine.vector.start
    sessions = rig.read(logs["base_tilt"])[:1]
    free = rig.open(sessions).machine.vector.start  # this arm has no tenth cable
    assert held.tolerances.jaw_held == (1.0,) and free.tolerances.jaw_held == (0.0,)
    assert free.tolerances.jaw_friction[0] < -2
    stiffness = np.exp(held.tolerances.strand_stiffness)
    assert stiffness[-2:] == pytest.approx(np.median(stiffness), rel=0.3)


def test_motors_that_never_move_show_nothing(logs, tmp_path):
    def still(session):
        first = {
            n: np.repeat(getattr(session, n)[:1], len(session), 0) for n in ("motor_position",)
        }
        return session.having(**first, motor_velocity=np.zeros_like(session.motor_velocity))

    rig = ArmRig()
    case = rig.open(rig.read(changed(logs["base_tilt"], tmp_path / "still", still))[:2])
    assert set(case.unseen) == set(case.candidates)
    assert all("no motor moves" in why for why in case.unseen.values())
