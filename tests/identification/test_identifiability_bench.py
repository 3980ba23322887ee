"""The predicted limit of detection against score tests on independent arms; a motor that never turns."""

from dataclasses import replace

import numpy as np
import pytest

from bench_arm import NONE, Job, draw, inject, record_many
from serpent_twin import machines
from serpent_twin.identification.acceptance import MIN_Z
from serpent_twin.identification.check_logs import Check, check
from serpent_twin.identification.detection import identifiability, opening_fit
from serpent_twin.identification.first_guess import guessed
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.score_test import scores
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.sessions import read_session, write_session

MACHINE = machines.find("arm")
EFFECT, SEED, SESSIONS, STEPS = "payload", 5, 2, 600
SUBSTEPS = 40
STILL = 3  # index of the motor that never turns

pytestmark = pytest.mark.slow


def record(folder, strength=0.0, sessions=SESSIONS, steps=STEPS):
    """Logs of one arm, with the effect."""
    arm = replace(draw(np.random.default_rng(SEED)), marker_noise=2e-4)
    effects = inject(EFFECT, strength, np.random.default_rng(1)) if strength else NONE
    record_many([Job(folder, arm, effects, 3, sessions, steps)], SUBSTEPS)
    return folder


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("limits")


def opened(logs):
    """A case with its segments and opening, and the effect where the arm has it: in the gripper."""
    read = MACHINE.read(logs)
    case = guessed(MACHINE.open(read), read, lambda _: None)
    pieces = case.pieces(read)
    case = case.reweighted(ParameterVector.nominal(case.declared), pieces)
    effect = case.candidates[EFFECT]
    return case, pieces, opening_fit(case, pieces), replace(effect, variants=effect.variants[:1])


@pytest.fixture(scope="module")
def limit(root):
    """Detection limit of the effect, from logs of the arm without it."""
    case, pieces, opening, effect = opened(record(root / "clean"))
    found = identifiability(
        case, pieces, opening, scores(case, pieces, opening, [effect]), lambda _, make: make()
    )
    return next(each for each in found.effects if each.name == EFFECT)


def score_test(logs):
    """Strength of the effect in a score test on the calibrated twin, and its standard error."""
    case, pieces, opening, effect = opened(logs)
    start, free = opening.point, free_parameters(case, ())
    first = fit(case, pieces, start, free, 1, case.segments[0], known=opening)
    case = case.reweighted(first.point, pieces)
    base = fit(case, pieces, first.point, free, 0, case.segments[0], carried=first)
    (found,) = scores(case, pieces, base, [effect])
    known, change = Information.of(case, base), found.change.astype(float)
    left, _, size = known.projected(change, base.residual.ravel().astype(float))
    strength = found.tried[0]
    return size * strength, strength / np.sqrt(known.weight * float(left @ change))


def test_twice_the_limit_that_is_told_is_beyond_three_standard_errors_and_a_clean_arm(root, limit):
    assert limit.told and 0 < limit.by_scatter < limit.by_gain == limit.limit
    zero, error = score_test(root / "clean")
    found, spread = score_test(record(root / "strong", 2 * limit.limit))
    assert found > MIN_Z * spread
    assert found > 2 * zero
    first_order = MIN_Z * error  # a fit of everything takes up more where hinges stick
    assert limit.by_scatter > 0.5 * first_order


def test_a_clean_arm_shows_far_less_than_is_told(root, limit):
    """More than scatter allows, as its hinges slide by another law of friction: 0.2 … 1 g on six."""
    found, _ = score_test(root / "clean")
    assert abs(found) < limit.limit / 3


def test_a_motor_that_never_turns_is_named_and_nothing_is_told_of_its_strands(root, tmp_path):
    record(root / "moves", sessions=1, steps=200)
    session = read_session(root / "moves" / "session_01.parquet")
    angle, velocity = session.motor_position.copy(), session.motor_velocity.copy()
    angle[:, STILL], velocity[:, STILL] = angle[0, STILL], 0.0
    name = f"motor {STILL + 1}"
    write_session(
        tmp_path / "session_01.parquet",
        session.having(motor_position=angle, motor_velocity=velocity),
    )
    found = check(Check((tmp_path,)))
    assert [each.name for each in found.inputs if each.still] == [name]
    assert f"{name.capitalize()} never moves" in found.sentence()
    if found.hidden:
        assert found.advice.startswith(f"Move {name}")
    ratio = {each.name: each.ratio for each in found.parameters}
    friction = [ratio[f"joint friction of motor{j + 1}"] for j in range(9)]
    assert friction[STILL] == pytest.approx(1.0, abs=1e-6)
    assert max(friction[:STILL] + friction[STILL + 1 :]) < 0.999
