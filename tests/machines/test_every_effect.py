"""Test every effect in every machine that may have it: absent at zero, else visible, stored and stable."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import held_models
import moving_models
import numpy as np
import pytest
from example import Example
from measured_logs import pendulum, write_log
from motion import wander
from numpy.testing import assert_allclose, assert_array_equal
from paths import ROOT

from experiments.arm_catalogue import CATALOGUE, candidates
from serpent_twin import effects, stored
from serpent_twin.arm.geometry import joint_from_motor
from serpent_twin.effects import KNOWN
from serpent_twin.errors import SerpentError
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.model import open_machine, simulated
from serpent_twin.machines.model.starts import with_starts
from serpent_twin.sim.arm_moment import Moment
from serpent_twin.sim.many_twins import impose
from serpent_twin.sim.prescribed_motion import DrivenArms
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Stretch, cut

_S = wander(6, pace=0.06)
MOVED = replace(_S, motors=replace(_S.motors, time=100.0 + _S.motors.time))
"""A second in which the arm's joints wander, when gears are still cold and cables have softened"""


@dataclass(frozen=True)
class Bench:
    """A machine that moves for a second or less."""

    candidates: Mapping[str, Candidate]
    respond: Callable[..., np.ndarray]
    """What is measured of twins, each with these effects, one row a twin"""


def arms(*several):
    """Markers [m] and loads of arms whose joints wander."""
    did = impose([TwinModel(effects=each) for each in several], MOVED)
    return _flat(did.marker, did.load)


def _flat(*arrays):
    return np.concatenate([each.reshape(len(each), -1) for each in arrays], axis=1)


def _points(machine, several):
    start = np.zeros(len(machine.declared))
    return [SimpleNamespace(declared=start, there=each) for each in several]


def _bench(machine, *logs):
    runs = cut(
        [Stretch.whole(log) for log in logs],
        machine.columns,
        [each.name for each in machine.outputs],
    )

    def respond(*several):
        with pytest.MonkeyPatch.context() as patch:  # zero is zero, not just off it
            patch.setattr(simulated, "effects_at", lambda point: getattr(point, "there", ()))
            return _flat(machine.respond(_points(machine, several), runs))

    return Bench(machine.candidates, cache(respond))


def _servo():
    """The servo of the experiment, at two P gains."""
    rig = open_machine(ROOT / "experiments" / "measured" / "xl330" / "machine.toml")
    with tempfile.TemporaryDirectory() as folder:
        for kp in (100, 400):
            about, columns = pendulum(kp, 0.01, 0.002, 0.1, seconds=1, seed=kp)
            write_log(Path(folder) / f"{kp}.parquet", about, **columns)
        logs = rig.read(Path(folder))
    return _bench(rig.open(logs).machine, *logs)


def _model():
    """Any MJCF: an arm of two links, whose elbow has no spring in the model."""
    with tempfile.TemporaryDirectory() as folder:
        path = moving_models.machine(Path(folder))
        model = path.with_name("arm.xml")
        model.write_text(model.read_text().replace('stiffness="0.8"', ""))
        rig = open_machine(path)
    time = np.arange(0.0, 0.5, 0.02)
    goal = {f"goal_{n}": 0.5 * np.sin(2 * np.pi * n * time) for n in (1, 2)}
    angle = {f"angle_{n}": 0.5 * goal[f"goal_{n}"] for n in (1, 2)}
    log = with_starts(rig.described, [Log(None, {}, {"time": time, **goal, **angle})])[0]
    return _bench(rig.open([log]).machine, log)


def _tendon():
    """Any MJCF: a lever that a tendon pulls, and a wheel that a motor turns."""
    with tempfile.TemporaryDirectory() as folder:
        Example(moving_models.LEVER, moving_models.LEVER_TOML).write(Path(folder))
        rig = open_machine(Path(folder) / "machine.toml")
    time = np.arange(0.0, 0.5, 0.02)
    told = {"pulled": 0.05 * np.sin(2 * np.pi * time), "current": 0.1 * np.cos(7 * time)}
    angle = {"angle_1": 9 * told["pulled"], "angle_2": 0.1 * np.sin(7 * time)}
    log = with_starts(rig.described, [Log(None, {}, {"time": time, **told, **angle})])[0]
    return _bench(rig.open([log]).machine, log)


def _torque():
    """An arm of two links whose motion is known, with the torques of its motors."""
    with tempfile.TemporaryDirectory() as folder:
        rig = open_machine(held_models.EXAMPLE.write(Path(folder)))
        (log,) = rig.read(held_models.log(Path(folder) / "log.csv", 0, rows=200))
    return _bench(rig.open([log]).machine, log)


BENCHMARKS = {
    "arm": Bench(candidates(), arms), "model": _model(), "tendon": _tendon(),
    "xl330": _servo(), "torque": _torque(),
}  # fmt: skip
MOST = dict.fromkeys(BENCHMARKS, 10.0) | {"torque": 1000.0}
"""Greatest response [m, rad, shares of stall; N m]"""
PAIRS = [(machine, name) for machine, bench in BENCHMARKS.items() for name in bench.candidates]
of_machines = pytest.mark.parametrize(("machine", "name"), PAIRS)
every = pytest.mark.parametrize("kind", KNOWN.values(), ids=KNOWN)


def made(machine, name, times=1.0):
    """A candidate as its machine has it, its strength times a number."""
    found = BENCHMARKS[machine].candidates[name]
    values = dict(zip(found.ranges, found.variants[0], strict=True))
    strength, (kind, at) = next(iter(values)), effects.placed(name)
    return kind(**{**values, strength: float(times * values[strength])}, at=at)


def test_every_effect_is_in_some_machine():
    """All but the one that a trace composes of a law and a place."""
    found = {effects.name_of(effects.placed(name)[0]) for _, name in PAIRS}
    assert found == set(KNOWN) - {"discovered"}


LEFT_OUT = {
    "drive_coupling",  # each of its motors turns one winch
    "discovered",  # a trace composes it, where named effects leave something
    "force_limit",  # what its motors can give is part of their bus
    "free_play",  # between its motors and hinges are cables, whose slack is their own
    "gravity",  # its size is known, and base_tilt turns it
    "hinge_friction",  # the calibration fits friction and damping of each hinge
    "joint_stiffening",  # a sleeve along the arm is joint_elasticity
    "rotor_inertia",  # its motors, which cables part from the hinges, follow their angles
    "sensor_delay",  # mocap_latency delays the cameras, motor_latency the motors
    "servo_lag",  # how its motors follow a speed is part of their bus
    "stribeck",  # the arm's gears turn with its motors, which cables part from the hinges
    "tendon_friction",  # its cables rub by their tension: cable_friction
}
"""Effects that the arm could have, which its machine.toml does not list, and why"""


def test_the_arm_tries_what_it_can_have():
    """A new effect is listed in model/machine.toml, or left out for a reason."""
    quantities = {each.name for each in fields(Moment)}
    assert {n for n, kind in KNOWN.items() if kind.needs <= quantities} == {*CATALOGUE, *LEFT_OUT}


@pytest.mark.parametrize("name", sorted(set(KNOWN) - set(CATALOGUE) - LEFT_OUT))
def test_what_the_arm_does_not_try_it_cannot_have(name):
    """An effect whose needs the arm does not meet."""
    with pytest.raises((SerpentError, AttributeError, ZeroDivisionError)):
        arms(KNOWN[name].variants())


@of_machines
def test_the_place_of_an_effect_is_of_a_known_kind(machine, name):
    one = BENCHMARKS[machine].candidates[name]
    kinds = ("joint", "tendon", "actuator", "body", "site", "sensor") if one.at else ("",)
    assert one.place_kind in kinds


@of_machines
def test_zero_is_the_nominal_twin_bit_for_bit(machine, name):
    """Alone, and beside a run that has it if both are of one structure."""
    kind, at = effects.placed(name)
    respond, zero, strong = BENCHMARKS[machine].respond, kind(at=at), made(machine, name)
    assert zero.absent and not strong.absent
    nominal = respond(())[0]
    assert_array_equal(respond((zero,))[0], nominal)
    try:
        both = respond((zero,), (strong,))
    except SerpentError as error:
        assert "structure" in str(error) and not strong.acts()
    else:
        assert_array_equal(both[0], nominal)


@of_machines
def test_a_typical_strength_shows(machine, name):
    """The change is more than rounding: 10 µm, 0.001 % of the stall torque, 10 µrad or 10 µN m somewhere."""
    respond = BENCHMARKS[machine].respond
    shown = respond((made(machine, name),)) - respond(())
    assert np.abs(shown).max() > 1e-5


@of_machines
def test_runs_side_by_side_are_the_runs_alone(machine, name):
    respond = BENCHMARKS[machine].respond
    one, other = (made(machine, name, times) for times in (1.0, 1.5))
    both = respond((one,), (other,))
    assert_allclose(both, np.concatenate([respond((one,)), respond((other,))]), rtol=0, atol=1e-9)


@of_machines
def test_a_second_at_the_end_of_the_range_is_finite(machine, name):
    """Responses are finite, and not out of all proportion."""
    found = BENCHMARKS[machine].candidates[name]
    values = dict(zip(found.ranges, found.variants[0], strict=True))
    strength, allowed = next(iter(found.ranges.items()))
    for least in (1e-4 * allowed.typical, allowed.high):
        kind, at = effects.placed(name)
        did = BENCHMARKS[machine].respond((kind(**{**values, strength: least}, at=at),))
        assert np.isfinite(did).all() and np.abs(did).max() < MOST[machine]


@every
def test_says_what_it_is(kind):
    assert "Source:" in kind.__doc__ and kind.shows_in
    assert set(kind.confused_with) <= set(KNOWN) - {effects.name_of(kind)}
    for name, allowed in effects.ranges(kind).items():
        assert allowed.unit and name
        assert -np.inf < allowed.low <= allowed.typical <= allowed.high < np.inf
        assert allowed.low <= kind.__dataclass_fields__[name].default <= allowed.high
    assert next(iter(effects.ranges(kind).values())).fitted


@every
def test_absent_by_default_present_in_all_its_variants(kind):
    assert kind().absent
    assert all(not variant.absent for variant in kind.variants())
    assert len({repr(variant) for variant in kind.variants()}) == len(kind.variants())


@every
def test_bounds_are_kept(kind):
    for name, allowed in effects.ranges(kind).items():
        for beyond in (allowed.high + 1, allowed.low - 1, np.nan):
            with pytest.raises(SerpentError, match=rf"{name} is .* must lie within"):
                kind(**{name: beyond})


@every
def test_comes_back_from_a_file(kind):
    for effect in kind.variants():
        entry = stored.take(effects.to_dict(effect), effects.Stored, "an effect")
        assert effects.restored(entry) == effect


def pulled(arm, first, off=0.0):
    """Tensions at the last of 40 rows [N], of an arm that is placed at a first row and again at row 30, there
    by an angle [rad] off.
    """
    motors, at, tension = wander(40, pace=0.08).motors, 30, []
    arms = DrivenArms([arm], [arm.spec(motors=False).compile()])
    for k in range(first, 40):
        if k in (first, at):
            pose = joint_from_motor(motors.angle[:, k, :9]) + (off if k == at else 0.0)
            arms.place(motors[:, k], pose, anew=k == first)
        else:
            arms.move(motors[:, k], 50)
        tension.append(arms.read().tension)
    return np.array(tension[-4:])


@pytest.mark.parametrize("name", sorted(CATALOGUE.keys() - {"cable_friction"}))
def test_memory_alone_outlives_a_restart(name):
    """An arm that remembers pulls otherwise after a restart than a fresh one: what forgets within 10 rows may
    begin every segment anew.
    """
    arm = TwinModel(effects=CATALOGUE[name].variants()[:1])
    long, short = pulled(arm, 0), pulled(arm, 30)
    assert (np.abs(long - short).max() > 0.02) == CATALOGUE[name].remembers


def test_what_bristles_hold_counts_as_a_pose_that_is_off_by_their_deflection():
    """Hinges which give way may thus begin every segment anew, too."""
    arm = TwinModel(effects=CATALOGUE["cable_friction"].variants()[:1])
    long, short, off = pulled(arm, 0), pulled(arm, 30), pulled(arm, 30, 1e-3)
    assert np.abs(long - short).max() < 1.5 * np.abs(off - short).max()
    assert not CATALOGUE["cable_friction"].remembers


def rubbed(speed, **given):
    """The friction that a hinge has at speeds [rad/s]."""
    rows, none = np.reshape(speed, (-1, 1)), np.zeros((np.size(speed), 1))
    moment = SimpleNamespace(**{"joint_velocity": rows, "joint_friction": none} | given)
    KNOWN["stribeck"](0.04, 0.2).act(moment, None)
    return moment.joint_friction[:, 0]


def test_stribeck_falls_with_speed_by_bo_and_pavelescu():
    """F_c + F exp(−|q̇| / v), either way, from F_c + F at rest to F_c."""
    speed = np.array([-50.0, -0.4, -0.1, 0.0, 0.1, 0.2, 50.0])
    friction = rubbed(speed, joint_friction=np.full((7, 1), 0.03))
    assert_allclose(friction, 0.03 + 0.04 * np.exp(-np.abs(speed) / 0.2), rtol=1e-12)
    assert friction.max() == friction[3] == pytest.approx(0.07)
