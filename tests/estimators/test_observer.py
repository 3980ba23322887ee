"""Test the pose and the covariance of a twin driven by the motors' angles alone."""

from dataclasses import replace

import numpy as np
import pytest

from serpent_twin.arm.control import random_targets
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects.payload import Payload
from serpent_twin.emulator.cameras import SimulatedMocap
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import find
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.readouts.score import score
from serpent_twin.readouts.windows import SessionWindows, cut
from serpent_twin.recording.collect import collect
from serpent_twin.recording.loop import TargetSteering, record
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import FIELDS, Session, read_folder
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

SOFT = TwinModel(
    replace(NOMINAL, strand_stiffness=4e3, strand_slack=6e-4, marker_noise=2e-4, load_noise=4e-3)
)


@pytest.fixture(scope="module")
def sessions(tmp_path_factory) -> list[Session]:
    """Sessions of an arm of the observer's own twin model, with noise."""
    out = tmp_path_factory.mktemp("soft")
    collect(Collect(out, sessions=3, steps=300, workers=1, parameters=SOFT.parameters))
    return read_folder(out)


@pytest.fixture(scope="module")
def observer(sessions):
    return trained(sessions)


def trained(sessions, twin: TwinModel = SOFT):
    made = find("observer")(4, twin=twin_model.to_dict(twin))
    made.fit(cut(sessions[:1], 4, 20), cut(sessions[1:2], 4, 20), np.random.default_rng(0))
    return made


def windows(session: Session, drop: int = 20) -> SessionWindows:
    return cut([session], 4, drop).sessions[0]


def error_mm(readout, session: SessionWindows) -> float:
    return score(readout.follow(session).marker, session.marker).mean_mm


def test_knows_the_arm_to_the_cameras_noise_where_geometry_is_far_off(sessions, observer):
    test = windows(sessions[2])
    stiff = find("analytical")(4)
    assert error_mm(stiff, test) > 15
    noise = 2e-4 * np.sqrt(8 / np.pi) * 1e3  # mean length of the cameras' error
    assert error_mm(observer, test) < noise + 0.3


def test_states_regions_that_hold_the_markers(sessions, observer):
    test = windows(sessions[2])
    belief = observer.follow(test)
    assert 0.90 <= belief.coverage(test.marker) <= 0.99
    assert 0.6 < belief.coverage(test.marker, 0.8) < 0.95
    spread = 1e3 * belief.spread.mean(axis=0)
    assert (0.3 < spread).all() and (spread < 2.0).all()


def test_live_says_what_follow_says_whatever_was_dropped(sessions, observer):
    test = windows(sessions[2])
    live = observer.live()
    one_by_one = [live.update(now) for now in readings(test.log)][20:]
    marker = np.concatenate([each.marker for each in one_by_one])
    np.testing.assert_array_equal(marker, observer.follow(test).marker)
    later = observer.follow(windows(sessions[2], drop=120))
    np.testing.assert_array_equal(later.marker, marker[100:])
    np.testing.assert_array_equal(later.covariance, observer.follow(test).covariance[100:])


def test_is_not_lost_by_ten_seconds_without_a_bus(sessions, observer):
    whole = sessions[2]
    kept = np.r_[0:100, 140:300]
    rows = {name: values[kept] for name, values in whole.columns.items()}
    session, undisturbed = whole.having(**rows), windows(whole, drop=180)
    assert error_mm(observer, windows(session, drop=101).some(0, 4)) < 15
    after = error_mm(
        observer, windows(session, drop=140)
    )  # friction remembers the lost path a while
    assert after < error_mm(observer, undisturbed) + 0.2


def test_is_not_lost_by_motors_that_reboot():
    bus = SimulatedBus(Twin(SOFT), np.random.default_rng(1), NOMINAL.load_noise)
    cameras = SimulatedMocap(bus.twin, np.random.default_rng(2), 2e-4)
    rows, targets = [], random_targets(320, np.random.default_rng(3))
    with bus:
        for part in (targets[:100], targets[100:]):
            rows += list(record(bus, cameras, TargetSteering(part, NOMINAL.controller_gain), 0.25))
            bus.reboot([2, 3, 7])
            bus.wait(2.0)  # three joints hang on motors that turn freely
    first, second = np.array([row["time"] for row in rows[:100]]), rows[100:]
    time = np.r_[first, first[-1] + 2.25 + np.array([row["time"] for row in second])]
    session = Session(
        None,
        {"schema_version": 1, "backend": "sim", "arm": "x", "session": 1, "rate_hz": 4.0},
        {name: np.array([row[name] for row in rows]) for name in FIELDS} | {"time": time},
    )
    readout = trained([session, session])
    assert error_mm(readout, windows(session, drop=108)) < 1.0


def test_doubts_itself_when_loads_say_that_the_arm_has_changed(sessions, observer, tmp_path):
    heavy = SOFT.with_effect(Payload(mass=0.05))
    twin_model.write(tmp_path / "twin.json", heavy, {})
    collect(Collect(tmp_path / "logs", sessions=1, steps=300, twin=tmp_path / "twin.json"))
    test = windows(read_folder(tmp_path / "logs")[0], drop=200)
    usual = observer.follow(windows(sessions[2], drop=200)).spread.mean()
    assert error_mm(observer, test) > 2
    assert observer.follow(test).spread.mean() > 1.4 * usual


def test_a_wrong_twin_states_how_wrong_it_was_in_training(sessions):
    wrong = trained(sessions, NOMINAL_TWIN)
    test = windows(sessions[2])
    assert error_mm(wrong, test) > 5
    assert 0.88 <= wrong.follow(test).coverage(test.marker) <= 0.995


def test_refuses_to_follow_untrained_and_rows_out_of_order(sessions, observer):
    test = windows(sessions[2])
    with pytest.raises(SerpentError, match="call fit or load first"):
        find("observer")(4).follow(test)
    live, rows = observer.live(), list(readings(test.log))
    live.update(rows[1])
    with pytest.raises(SerpentError, match="came after one"):
        live.update(rows[0])
