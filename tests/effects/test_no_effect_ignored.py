"""Test that every way of running uses an effect, or refuses it in words."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from moments import moment
from motion import wander
from numpy.testing import assert_allclose

from serpent_twin import sessions
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects import KNOWN, Effect, parameter
from serpent_twin.effects.effect import WINDING
from serpent_twin.emulator.motors import SimulatedMotors
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import find
from serpent_twin.estimators.bus_reading import BusReading
from serpent_twin.live.estimate import estimate
from serpent_twin.live.follower import Follower
from serpent_twin.live.options import Estimate
from serpent_twin.playback import rerun_recording
from serpent_twin.playback.recording import play_back
from serpent_twin.readouts.windows import cut
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import read_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.arm_moment import Moment
from serpent_twin.sim.many_twins import TIMESTEP, impose
from serpent_twin.sim.twin import Twin, replay_motors
from serpent_twin.sim.twin_model import TwinModel

WORN = TwinModel(effects=(KNOWN["stiffness_drift"](0.5, carries=1.0),))
HALF = TwinModel(replace(NOMINAL, strand_stiffness=0.5 * NOMINAL.strand_stiffness))
HOUR = 3600.0


@dataclass(frozen=True)
class Made(Effect):
    """An effect that an author may have written; what it does is in `does`."""

    size: float = parameter("1", high=10.0, typical=1.0)
    """[1]"""

    stage: ClassVar[int] = WINDING
    does: ClassVar = staticmethod(lambda moment: None)

    def act(self, moment, memory):
        """Do as told."""
        type(self).does(moment)


def doing(does):
    """A twin with an effect that does this to its moment."""
    kind = dataclass(frozen=True)(type("Doing", (Made,), {"does": staticmethod(does)}))
    return TwinModel(effects=(kind(1.0),))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Sessions 1 and 2 of half a minute, and an observer of a twin that wears."""
    folder = tmp_path_factory.mktemp("worn")
    collect(Collect(folder / "logs", sessions=2, steps=60, workers=1, seed=5))
    first, second = (
        cut([read_session(folder / "logs" / f"session_0{n}.parquet")], 4, drop=10) for n in (1, 2)
    )
    observer = find("observer")(4, twin=twin_model.to_dict(WORN))
    observer.fit(first, second, np.random.default_rng(0))
    observer.save(folder / "observer")
    return folder


def test_replay_of_a_later_session_wears_the_twin(folder, tmp_path, monkeypatch):
    """`replay --twin` of a session after an hour of others: strands half as stiff."""
    path, shown = folder / "logs" / "session_02.parquet", {}
    session = read_session(path)
    twin_model.write(tmp_path / "twin.json", WORN, {})
    late = replace(session, metadata=session.metadata | {"prior_runtime_s": HOUR})
    monkeypatch.setattr(sessions, "read_session", lambda _: late)
    monkeypatch.setattr(rerun_recording, "write", lambda *_, corrected: shown.update(it=corrected))
    play_back(path, tmp_path / "a.rrd", None, tmp_path / "twin.json")
    soft = replay_motors(session.time, session.motor_position, HALF)
    fresh = replay_motors(session.time, session.motor_position, WORN)
    off, before = (np.abs(x.marker - soft.marker).mean() for x in (shown["it"], fresh))
    assert off < 0.05 * before


def test_sessions_of_a_run_lie_one_after_the_other(folder):
    first, second = (read_session(folder / "logs" / f"session_0{n}.parquet") for n in (1, 2))
    assert first.prior_runtime == 0
    assert second.prior_runtime == pytest.approx(15, abs=0.5)
    told = replace(second, metadata=second.metadata | {"prior_runtime_s": 12.5})
    assert told.prior_runtime == 12.5


def test_a_live_estimate_wears_the_readouts_twin(monkeypatch):
    """An observer that is told of an hour believes what one of half as stiff strands does, in time steps of
    one length: softer strands would take longer ones.
    """
    monkeypatch.setattr("serpent_twin.estimators.observer.coarse_step", lambda _: TIMESTEP)
    observer = find("observer")(4, twin=twin_model.to_dict(WORN))
    observer.learned = {"servo_lag": 0.0, "joint": np.zeros((9, 9)), "load": np.ones(10),
                        "rest": np.tile(np.eye(3), (9, 1, 1)), "scale": 1.0}  # fmt: skip
    soft = observer.with_twin(HALF)
    still = np.zeros(10)
    now = BusReading(0.0, np.full(10, 0.4), still, still, still)
    worn, fresh, half = (
        follower._live.update(now).marker
        for follower in (
            Follower(observer, 1, prior_runtime=HOUR),
            Follower(observer, 1),
            Follower(soft, 1),
        )
    )
    assert_allclose(worn, half, atol=1e-5)
    assert np.abs(fresh - half).max() > 1e-3


def test_estimate_takes_the_runtime_and_logs_it(folder, tmp_path):
    """The simulated arm and the observer's twin wear alike, and the log says for how long."""
    few = {"steps": 12, "record": False}
    old = estimate(Estimate(folder / "observer", tmp_path / "old", prior_runtime_h=1.0, **few))
    new = estimate(Estimate(folder / "observer", tmp_path / "new", **few))
    logs = [read_session(tmp_path / name / "session_01.parquet") for name in ("old", "new")]
    assert [log.prior_runtime for log in logs] == [HOUR, 0.0]
    assert np.abs(logs[0].marker - logs[1].marker).max() > 1e-3
    assert old["mean_error_mm"] < 3 * new["mean_error_mm"]


def test_a_runtime_that_nothing_uses_is_refused(folder, tmp_path):
    linear = find("linear")(4).trained
    train = cut([read_session(folder / "logs" / "session_01.parquet")], 4, drop=10)
    linear.fit(train, train, np.random.default_rng(0))
    linear.save(tmp_path / "linear")
    with pytest.raises(SerpentError, match=r"--prior-runtime-h would be ignored: .* no twin"):
        estimate(
            Estimate(tmp_path / "linear", tmp_path / "out", backend="real", prior_runtime_h=1.0)
        )


@pytest.mark.parametrize("delay", [0.04, 0.043])
def test_the_bus_reports_what_motors_did_before(delay):
    """All that it reads, but not the markers, is that of a prompt arm so much earlier."""
    late = TwinModel(effects=(KNOWN["motor_latency"](delay),))
    buses = [SimulatedBus(Twin(arm)) for arm in (late, TwinModel())]
    read = {bus: [] for bus in buses}
    for bus in buses:
        with bus:
            bus.enable_torque()
            bus.write_velocity(np.full(10, 0.4))
            for _ in range(100):
                bus.wait(0.002)
                state = bus.read_state()
                read[bus].append(np.stack([state.position, state.velocity, state.load]))
        read[bus] = np.array(read[bus])
    old, now = read.values()
    steps = delay / 0.002
    whole = int(steps)
    between = now[60 - whole] + (steps - whole) * (now[59 - whole] - now[60 - whole])
    units = np.array([2 * np.pi / 4096, 0.229 * 2 * np.pi / 60, 1e-3])[:, None]
    assert (np.abs(old[60] - between) < 1.1 * units).all()
    assert (np.abs(old[60] - now[60])[0] > 5 * units[0]).any()
    assert_allclose(buses[0].twin.markers, buses[1].twin.markers, atol=1e-12)


def test_a_live_estimate_carries_the_pose_on_by_its_velocity():
    """An arm whose motors report late is further by the delay times its markers' velocity."""
    observer = find("observer")(4, twin=twin_model.to_dict(TwinModel()))
    observer.learned = {"servo_lag": 0.0, "joint": np.zeros((9, 9)), "load": np.ones(10),
                        "rest": np.tile(np.eye(3), (9, 1, 1)), "scale": 1.0}  # fmt: skip
    late, prompt = (
        observer.with_twin(TwinModel(effects=(KNOWN["motor_latency"](0.05),))).live(),
        observer.live(),
    )
    step, still = prompt._timestep, np.zeros(10)

    def told(live, time):
        return live.update(
            BusReading(time, 0.1 * time * np.arange(1, 11), still, still, still)
        ).marker

    told(prompt, 0.0), told(late, 0.0)
    for time in 0.25 * np.arange(1, 8):
        just_before = told(prompt, time - step)
        now, carried = told(prompt, time), told(late, time)
        if time > 1.0:
            assert_allclose(carried, now + 0.05 * (now - just_before) / step, atol=1e-6)
            assert np.abs(carried - now).max() > 1e-3


def test_an_arm_strung_anew_stays_worn():
    """Torn apart after an hour and ten seconds, it has run for that long."""
    twin = Twin(WORN, prior_runtime=HOUR)
    twin.advance(np.zeros(10), 10.0)
    motors = SimulatedMotors(twin, np.random.default_rng(0))
    motors.restring()
    assert motors.twin.runtime == HOUR + 10
    motors.twin.advance([0.4] * 10, 1.0)
    pulls = motors.twin.tension[0] > 1.0
    stretch = motors.twin.batch.bind("ten_length")[0, pulls] - NOMINAL.strand_slack
    assert_allclose(
        motors.twin.tension[0, pulls] / stretch, NOMINAL.strand_stiffness / 2, rtol=5e-3
    )
    motors.restring()
    assert motors.twin.runtime == HOUR + 11


@pytest.mark.parametrize("name", sorted(Moment.given - {"arm", "dt"}))
def test_what_was_measured_cannot_be_changed(name):
    def rebind(moment):
        setattr(moment, name, 0.0)

    def write(moment):
        getattr(moment, name)[...] = 0.0

    with pytest.raises(
        SerpentError, match=f"effect Doing cannot act here: {name} cannot be changed"
    ):
        impose([doing(rebind)], wander(3))
    with pytest.raises(SerpentError, match="effect Doing cannot act here: it writes into an array"):
        impose([doing(write)], wander(3))


def test_what_can_be_changed_is_listed():
    with pytest.raises(
        SerpentError, match=r"Effects change winch_angle, slack, stiffness, .*stiffening"
    ):
        moment().winch_ratio = 1.1


def test_stiffening_by_an_effect_pulls_as_stiffening_cables_do():
    """Given in Python, it is what MJCF expresses: in the strands, in the loads, and beside drives."""
    given = doing(lambda moment: setattr(moment, "stiffening", np.full((1, 20), 800.0)))
    cables = TwinModel(effects=(KNOWN["cable_stiffening"](800.0),))
    one, other, none = (impose([arm], wander(12)) for arm in (given, cables, TwinModel()))
    assert_allclose(one.marker, other.marker, atol=1e-9)
    assert_allclose(one.load, other.load, atol=1e-9)
    assert_allclose(one.tension, other.tension, atol=1e-6)
    assert np.abs(one.tension - none.tension).max() > 0.1
    twins = [Twin(arm) for arm in (given, cables)]
    for twin in twins:
        twin.advance([0.3] * 10, 1.0)
    assert_allclose(twins[0].tension, twins[1].tension, atol=1e-6)


def test_a_memory_of_unsaid_length_is_refused():
    def start(self, moment):
        return np.zeros(1)

    with pytest.raises(SerpentError, match=r"Forgetful has a memory.*`remembers: ClassVar\[bool\]"):
        type("Forgetful", (Effect,), {"start": start})
    for lasts in (True, False):
        assert type("Said", (Effect,), {"start": start, "remembers": lasts}).remembers is lasts
