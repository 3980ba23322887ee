"""Test laws composed for the soft trunk against goals that are changed by hand before a simulation."""

from dataclasses import replace

import numpy as np
import pytest
from trunk_runs import answer, log, made, moving, shape

from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import HANDLES, Law, parse
from serpent_twin.errors import SerpentError
from serpent_twin.identification.discovery import discover
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.measured.twin_file import read_twin
from serpent_twin.machines.trunk import MACHINE, Trunk
from serpent_twin.machines.trunk.motion import CHANGED, PLACES, TrunkMoment
from serpent_twin.machines.trunk.shape import GOALS, SEEN
from serpent_twin.tables.segments import Stretch, cut


def numbers(*size, first=0.0):
    """All numbers of a law of one size."""
    return [*size, 0.0, 0.0, 0.0, first, 0.0, 0.0, 0.0]


def runs_of(machine, run):
    """A run as it is, with what is seen of it."""
    return cut(
        [Stretch.whole(run)],
        machine.columns,
        [each.name for each in machine.outputs],
        machine.every,
    )


def one(rows=3):
    """A moment of three trunks."""
    rng = np.random.default_rng(0)
    six = {
        n: rng.normal(size=(rows, 6))
        for n in ("motor_velocity", "cable_torque", "stood", "goal", "motor_angle", "winch_angle")
    }
    dt, time = np.full((rows, 1), 0.01), np.full((rows, 1), 70.0)
    disk, shift = rng.normal(size=(rows, 9)), np.zeros((rows, 9))
    return TrunkMoment(dt=dt, time=time, disk=disk, marker_shift=shift, **six)


def calibrated(machine, run):
    """The case of a log, its runs, and the fit of the declared parameters, by which channels are weighed."""
    case = Case(machine, np.array([each.noise for each in machine.outputs]))
    runs, start = case.pieces([run]), ParameterVector.nominal(case.declared)
    case = case.reweighted(start, runs)
    base = fit(case, runs, start, free_parameters(case, ()), 2, 3)
    return case.weighed_by(base.residual, case.take(runs, base.used)), runs, base


def test_what_laws_follow_is_what_the_moment_holds():
    moment = one()
    for text, expected in (
        ("motor_angle of motor2", moment.motor_angle[:, 1]),
        ("motor_velocity of motor3", (moment.motor_angle - moment.stood)[:, 2] / 0.01),
        ("horn_torque of motor6", moment.cable_torque[:, 5]),
        ("command of motor1", moment.goal[:, 0]),
        ("position_y of disk3", moment.disk[:, 7]),
        ("time of session", moment.time[:, 0]),
    ):
        found = moment.reading_of(parse(f"winch_angle of motor1: linear {text}"))
        np.testing.assert_array_equal(found[:, 0], expected)


@pytest.mark.parametrize(
    ("law", "says"),
    [
        ("slack of cable1_plus: constant", "no law changes slack here; there are: winch_angle"),
        ("winch_angle of motor7: constant", "no place 'motor7' here; there are: motor1.*motor6"),
        ("winch_angle of motor1: linear tension of cable1_plus", "no law follows the tension of cable"),
        ("winch_angle of motor1: linear runtime of machine", "no law follows the runtime.* time"),
        ("winch_angle of motor1: linear position_x of disk4", "no place 'disk4' here.*disk3"),
    ],
)  # fmt: skip
def test_a_law_that_the_trunk_does_not_honour_is_refused_in_words(law, says):
    with pytest.raises(SerpentError, match=says):
        answer(Trunk(shape()), log([0.1] * 6, 0.5), **{f"discovered@{law}": numbers(0.1)})


def test_a_turned_winch_is_another_goal_that_the_servo_does_not_show():
    """And with another command, it shows: goals changed by hand move the disks alike."""
    machine, goal = Trunk(shape(), every=1), moving(4)
    other = goal.copy()
    other[:, 2] += 0.3 * np.maximum(goal[:, 2] - 0.1, 0.0)
    plain, changed = answer(machine, log(goal)), answer(machine, log(other))
    at = "of motor3: beyond {} of motor3"
    wound, told = (
        answer(machine, log(goal), **{f"discovered@{law}": numbers(0.3, first=0.1)})
        for law in (f"winch_angle {at}".format("motor_angle"), f"command {at}".format("command"))
    )
    np.testing.assert_allclose(wound[0], changed[0], atol=1e-4)
    np.testing.assert_array_equal(wound[1], plain[1])
    np.testing.assert_allclose(told[0], wound[0], atol=1e-12)
    np.testing.assert_allclose(told[1], changed[1], atol=1e-3)  # between rows, not all is linear


def test_a_shifted_marker_is_one_that_sits_elsewhere_on_its_disk():
    goal, shift = moving(4), [0.004, -0.006, 0.008]
    sits = np.array([0.002, 0.003, -0.001] * 3) + np.r_[np.zeros(3), shift, np.zeros(3)]
    elsewhere = answer(Trunk(shape(disk=sits)), log(goal))[0]
    law = {"discovered@marker_shift of marker2: constant": [*shift, *[0.0] * 5]}
    np.testing.assert_allclose(answer(Trunk(shape()), log(goal), **law)[0], elsewhere, atol=1e-12)


def test_the_clock_is_the_sessions_in_every_window():
    """What turns a winch from 13 s on does so in the rows from then on, whichever window holds them."""
    machine, run = Trunk(shape(), every=1, window=(4.0, 2.0)), log(np.zeros((2400, 6)))
    runs = machine.pieces([run])
    law = "discovered@winch_angle of motor2: above time of session"
    there = machine.respond(
        [ParameterVector.nominal(machine.declared, {law: np.array(numbers(0.2, first=13.0))})],
        runs,
    )[0]  # fmt: skip
    usual = machine.respond([ParameterVector.nominal(machine.declared)], runs)[0]
    moved = np.abs(there - usual)[..., 8] > 1e-4
    since = runs.time - 13.0
    assert len(runs) == 5
    assert not moved[since < 0].any()
    assert moved[:, 50:][
        since[:, 50:] > 0.2
    ].all()  # a window begins unwound, and settles before it counts


@pytest.mark.parametrize(
    ("handle", "reading"),
    [
        ("winch_angle", "motor_angle of motor4"),
        ("winch_angle", "horn_torque of motor2"),
        ("command", "command of motor4"),
        ("marker_shift", "motor_angle of motor4"),
    ],
)
def test_to_first_order_a_response_is_what_a_small_change_shows(handle, reading):
    machine, run = Trunk(shape()), log(moving(6))
    runs, start = runs_of(machine, run), ParameterVector.nominal(machine.declared)
    places = machine.responses_at_places(start, runs)
    found = {(each.handle, each.place): each.change[0] for each in places.responses}
    place = PLACES[HANDLES[handle].kind][1]
    assert set(found) == {
        (handle, name) for handle in CHANGED for name in PLACES[HANDLES[handle].kind]
    }
    usual, there = machine.respond(
        [start, start.having(f"discovered@{handle} of {place}: linear {reading}", np.array(numbers(0.02)))],
        runs,
    )  # fmt: skip
    follows = 0.02 * places.readings[tuple(reading.split(" of "))]
    expected = follows[..., None] * found[handle, place]
    settled = slice(10, None)
    apart = np.linalg.norm((there - usual - expected)[:, settled])
    assert apart < 0.1 * np.linalg.norm(expected[:, settled])


def test_readings_are_those_that_a_law_follows_behind_a_delay():
    """A twin whose goals arrive late follows late goals, in the search as in the simulation."""
    machine, run = Trunk(shape()), log(moving(4))
    runs, start = runs_of(machine, run), ParameterVector.nominal(machine.declared)
    late = machine.responses_at_places(start.having("command_delay", np.array([0.2])), runs)
    for reading in ("command", "motor_angle"):
        found = late.readings[reading, "motor1"][0]
        goal = runs.column[GOALS[0]][0]
        np.testing.assert_allclose(found[10:], goal[6:-4], atol=2e-3)


@pytest.mark.slow
def test_a_winch_that_turns_further_beyond_an_angle_is_found_at_its_motor(tmp_path):
    """The log's disks are of goals that were changed by hand; its servos stand at the plain ones."""
    machine, goal = Trunk(shape()), moving(34)
    further = np.zeros_like(goal)
    further[:, 1] = 0.25 * np.maximum(goal[:, 1] - 0.3, 0.0)
    plain, wound = made(machine, goal), made(machine, goal + further)
    run = replace(plain, columns=plain.columns | {name: wound.columns[name] for name in SEEN})
    case, runs, base = calibrated(machine, run)
    best, *_ = discover(case, runs, base, False, lambda _: None)
    law = parse(best.at)
    assert law == Law("winch_angle", "motor2", "beyond", "motor_angle", "motor2")
    assert best.place["place"] == {"kind": "actuator", "name": "motor2"}
    case = case.composing([best])
    begun = base.point.having(best.name, best.variants[0])
    found = fit(case, runs, begun, free_parameters(case, [best.name]), 2, 3)
    size, _, _, _, first, *_ = found.point.effects[best.name]
    assert size == pytest.approx(0.25, rel=0.1)
    assert first == pytest.approx(0.3, abs=0.05)
    case.write(found.point, tmp_path / "twin.json", {})
    (stored,) = read_twin(tmp_path / "twin.json", "trunk").several
    assert isinstance(stored, Discovered)
    assert stored.law == law
    assert MACHINE.changed(tmp_path / "twin.json").open([run]).machine.fixed == (stored,)


def test_of_a_trunk_that_lacks_nothing_nothing_is_composed():
    machine = Trunk(shape())
    case, runs, base = calibrated(machine, made(machine, moving(34)))
    assert not discover(case, runs, base, True, lambda _: None)


def test_units_are_those_of_angles():
    machine = Trunk(shape())
    law = parse("command of motor3: beyond command of motor3")
    assert machine.units_of_law(law) == {
        "size": "rad per rad", "first": "rad", "second": "rad", "bound": "rad"
    }  # fmt: skip
    law = parse("winch_angle of motor3: linear horn_torque of motor3")
    assert machine.units_of_law(law)["size"] == "rad per N m"
