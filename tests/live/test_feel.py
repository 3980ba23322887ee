"""What is felt of known pushes of the simulated arm, live and from its log, and who cannot feel."""

import json
from dataclasses import replace

import numpy as np
import pytest
from live_runs import column, estimated, logged, train_few

from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects.base_tilt import BaseTilt
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import load
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.estimators.feeling import feeling
from serpent_twin.estimators.force_filter import FeltForce
from serpent_twin.live.contacts import COLUMNS, CONTACT, FORCE, LINK, TOUCHED, Touch
from serpent_twin.live.estimate import estimate
from serpent_twin.live.options import Estimate
from serpent_twin.sim.twin_model import NOMINAL_TWIN

GRAVITY = np.array(ARM.gravity)
DAMPED = replace(NOMINAL, joint_damping=0.02)
PUSH = "link,begin,end,force_x,force_y,force_z,shape\n9,10,20,0.2,0.7,-0.4,step\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An observer and a readout of windows, trained on a few rows, and a push of 0.83 N on link 9. The arm
    is damped enough not to swing for seconds after a push.
    """
    made = tmp_path_factory.mktemp("feel")
    train_few(made, ("observer", "residual"), DAMPED)
    (made / "push.csv").write_text(PUSH)
    return made


@pytest.fixture(scope="module")
def run(folder):
    """A run with the push, that feels."""
    config = Estimate(
        folder / "observer",
        folder / "felt",
        steps=120,
        force=True,
        push=str(folder / "push.csv"),
    )
    return estimate(config), logged(folder / "felt")


def test_a_push_is_felt_on_its_link_with_its_direction(run):
    found, session = run
    pushed = (session.extra["push_link"] == 9) & (session.time > 11.5)
    free = session.time < 10
    force = np.stack([session.extra[name] for name in FORCE], axis=1)
    assert np.mean(session.extra[TOUCHED][pushed]) > 0.9
    assert not session.extra[TOUCHED][free].any()
    assert np.mean(np.abs(session.extra[LINK][pushed] - 9) <= 1) > 0.8
    off = np.linalg.norm(force[pushed] - [0.2, 0.7, -0.4], axis=1)
    assert np.median(off) < 0.4  # of 0.83 N
    (contact,) = found["contacts"]
    assert 10 < contact["begin_s"] <= 12 and contact["link"] in (8, 9)
    assert contact["weight_kg"] is None
    assert found["force_error_free_N"] < 0.3 and found["force_error_pushed_N"] < 0.5


def test_the_pose_gives_way_to_the_push(folder, run):
    session = run[1]
    pushed = session.extra["push_link"] == 9
    observer = load(folder / "observer").live()
    blind = np.array([observer.update(now).marker[0] for now in readings(session)])
    far = [np.linalg.norm(each - session.marker, axis=2) for each in (estimated(session), blind)]
    assert np.nanmean(far[0][pushed]) < 0.6 * np.nanmean(far[1][pushed])


def test_what_is_felt_live_is_what_the_log_says(folder, run):
    session = run[1]
    live = feeling(load(folder / "observer")).live()
    for k, now in enumerate(readings(session)):
        live.update(now)
        felt = live.force()
        assert [session.extra[name][k] for name in FORCE] == pytest.approx(felt.force, abs=1e-9)
        assert session.extra[CONTACT][k] == pytest.approx(felt.contact, abs=1e-9)


def test_results_and_recording_hold_it(folder, run):
    found, session = run
    assert json.loads((folder / "felt" / "results.json").read_text()) == found
    assert all(np.isfinite(session.extra[name]).all() for name in COLUMNS)
    path = folder / "felt" / "session_01.rrd"
    steps, vectors = column(path, "/arm/force", "Arrows3D:vectors")
    shown = [n for n, vector in zip(steps, vectors, strict=True) if vector]
    assert shown == np.flatnonzero(session.extra[TOUCHED]).tolist()
    first = shown[0]
    at = [session.extra[name][first] for name in FORCE]
    assert np.ravel(vectors[first]) == pytest.approx(0.1 * np.array(at), rel=1e-5)


def test_a_readout_of_windows_feels_nothing_and_says_so(folder):
    config = Estimate(folder / "residual", folder / "none", force=True)
    with pytest.raises(SerpentError, match="residual feels no force: that takes an observer"):
        estimate(config)
    assert not (folder / "none").exists()


def lasting(force, seconds=20.0, gravity=GRAVITY):
    contact = Touch(gravity)
    known = 0.01 * np.eye(3)
    for n, now in enumerate(force):
        contact.time.append(n * seconds / len(force))
        links = np.eye(9)[8]
        contact.felt.append(
            FeltForce(
                1.0, True, 9, links, now, known, np.tile(now, (9, 1)), np.tile(known, (9, 1, 1))
            )
        )
    return contact


def test_a_weight_pulls_down_and_stays():
    """The base frame's x points down."""
    rng = np.random.default_rng(0)
    down = np.tile([0.49, 0.0, 0.0], (80, 1)) + 0.05 * rng.standard_normal((80, 3))
    assert lasting(down).found()["weight_kg"] == pytest.approx(0.05, rel=0.05)
    assert lasting(-down).found()["weight_kg"] is None
    assert lasting(down[:, [1, 0, 2]]).found()["weight_kg"] is None
    assert lasting(down, seconds=3.0).found()["weight_kg"] is None
    swinging = down * np.linspace(0.0, 2.5, 80)[:, None]
    assert lasting(swinging).found()["weight_kg"] is None


def test_a_weight_on_a_base_that_leans_pulls_along_the_twins_gravity():
    """A turn by 0.4 rad about y moves what pulls along x against z."""
    twin = NOMINAL_TWIN.with_effect(BaseTilt(about_y=0.4))
    expected = 9.81 * np.array([np.cos(0.4), 0.0, -np.sin(0.4)])
    assert twin.gravity == pytest.approx(expected, abs=1e-12)
    pulled = np.tile(0.05 * expected, (80, 1))
    assert lasting(pulled, gravity=twin.gravity).found()["weight_kg"] == pytest.approx(0.05)
    assert lasting(pulled).found()["weight_kg"] is None
