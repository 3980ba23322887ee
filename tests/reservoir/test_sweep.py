"""Test that a sweep measures each grid point once, correctly, and the same wherever it runs."""

import json
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from sweep_cases import GRID, POINT, QUICK, UNSTABLE, files
from typed import typed

from serpent_twin.arm.geometry import joint_from_motor, markers
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.errors import SerpentError
from serpent_twin.recording.options import Collect
from serpent_twin.recording.simulated import simulate_session
from serpent_twin.reservoir import (
    body,
    capacities,
    check_inputs,
    drive,
    expand,
    memory,
    pose,
    rigid,
    taps,
)
from serpent_twin.reservoir import sweep_run as run
from serpent_twin.reservoir.grid_point import GridPoint, Measuring, key
from serpent_twin.reservoir.measures import overlap
from serpent_twin.reservoir.outcome import Outcome, measured, rounded
from serpent_twin.reservoir.sweep_run import Sweep, sweep
from serpent_twin.sessions import FIELDS, read_session
from serpent_twin.sim.twin_model import TwinModel


def written(out: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in (out / "points").iterdir()}


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    config = Sweep(tmp_path_factory.mktemp("sweep") / "out", workers=1, **GRID)
    return config, sweep(config), written(config.out)


@pytest.fixture(scope="module")
def grown(first):
    """Sweep in the folder of `first` over another grid, which shares a point with the first."""
    config = replace(first[0], stiffness=(8e3, UNSTABLE))
    return config, sweep(config), files(config.out)


def test_a_grid_becomes_a_file_a_point_and_a_table(first):
    config, table, times = first
    assert len(table["points"]) == 2 == len(times)
    assert json.loads((config.out / "table.json").read_text()) == table
    names = {key(point, QUICK) + ".json" for point in run.grid(config)}
    assert names == set(times) == {point["file"] for point in table["points"]}
    about = json.loads((config.out / "provenance" / min(names)).read_text())
    assert about["versions"]["mujoco"] and about["host"] and about["seconds"]["simulation"] > 0


def test_what_is_there_is_not_measured_again(first, grown):
    config, _, before = first
    after = written(config.out)
    assert {name: after[name] for name in before} == before
    assert len(after) == 3
    one = config.out / "points" / min(before)
    one.unlink()
    assert len(sweep(config)["points"]) == 2
    again = written(config.out)
    assert [name for name in after if again[name] != after[name]] == [one.name]
    assert files(config.out) == grown[2]


def test_an_unstable_twin_is_recorded_and_the_sweep_goes_on(grown):
    of = {point["point"]["strand_stiffness_n_per_m"]: point for point in grown[1]["points"]}
    assert "became unstable at time steps of 0.5 ms" in of[UNSTABLE]["failed"]["simulation"]
    assert of[UNSTABLE]["body"] is None and of[UNSTABLE]["pose"] is None
    assert not of[8e3]["failed"] and of[8e3]["body"] and of[8e3]["pose"]


def test_two_processes_write_the_same_bytes_as_one(grown, tmp_path):
    config = replace(grown[0], out=tmp_path / "two", workers=2)
    sweep(config)
    assert files(config.out) == grown[2]


def test_a_folder_holds_points_measured_alike(first):
    coarser = replace(first[0], measuring=replace(QUICK, washout=9))
    with pytest.raises(SerpentError, match=r"measuring\.washout was 8, now 9"):
        sweep(coarser)


def test_a_worker_with_other_versions_is_refused(first):
    config = first[0]
    outcome = Outcome("{}", {"mujoco": "3.2"}, "abc", "node7", {})
    with pytest.raises(SerpentError, match=r"node7 computes with .*3\.2.* install the same"):
        run._keep(config, replace(POINT, seed=9), outcome)


def test_every_parameter_and_setting_names_another_file():
    names = {key(POINT, QUICK), key(replace(POINT, stiffness=None), QUICK)}
    for each in fields(GridPoint):
        names.add(key(replace(POINT, **{each.name: 1.5 * getattr(POINT, each.name) + 0.01}), QUICK))
    for each in fields(Measuring):
        value = getattr(QUICK, each.name)
        other = (*value, *value) if isinstance(value, tuple) else 2 * (value or 1) + 1
        names.add(key(POINT, replace(QUICK, **{each.name: other})))
    assert len(names) == 2 + len(fields(GridPoint)) + len(fields(Measuring))
    assert key(replace(POINT, stiffness=8000), QUICK) == key(POINT, QUICK)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"amplitude": (0.02,)}, r"± 0.02 rad at 20 Hz may ask 9.0 rad/s .* at most 0.0141 rad"),
        ({"amplitude": (1.1,), "rate": (0.01,)}, "amplitude is 1.1 rad; .* up to 1.047"),
        ({"rate": (0.0,)}, "--rate is 0; give a number from 0.01"),
        ({"stiffness": (-1.0,)}, "--stiffness is -1; .* N/m"),
        ({"slack": (-1.0,)}, "--slack is -1; .* m"),
        ({"seeds": (-1,)}, "--seeds is -1"),
        ({"workers": -1}, "--workers is -1"),
        ({"stiffness": ()}, None),
        ({"stiffness": (), "rigid": False}, "no points"),
        ({"measuring": replace(QUICK, coarsest=0.1)}, r"200 rows and 29 .* use \d,\d\d\d rows"),
        ({"measuring": replace(QUICK, washout=5)}, "--washout is 5 .* reach 6 back"),
        ({"measuring": replace(QUICK, session_steps=100)}, "--session-steps is 100"),
        ({"measuring": replace(QUICK, epochs=0)}, "--epochs is 0"),
        ({"measuring": replace(QUICK, delays=())}, "Degree 0 with greatest delays"),
        ({"measuring": replace(QUICK, delays=(8, 8, 8, 8))}, "at most 1,000,000 are searched"),
        ({"measuring": replace(QUICK, readouts=("linaer",))}, "Did you mean linear"),
    ],
)
def test_what_cannot_be_measured_is_refused_before_anything_is_written(changed, said, tmp_path):
    if said is None:
        config = Sweep(tmp_path / "out", **(GRID | changed))
        run._check(config, run.grid(config))
        return
    with pytest.raises(SerpentError, match=said):
        sweep(Sweep(tmp_path / "out", **(GRID | changed)))
    assert not (tmp_path / "out").exists()


def test_motors_reach_each_target_within_its_period_and_hold_it():
    rate, amplitude = 4.0, 0.07
    u = np.random.default_rng(0).uniform(-1, 1, (3, 201, 9))
    s = drive.motors_of(amplitude * u, rate)
    drive.check(rate, amplitude)
    assert np.diff(s.time[0, 1:]) == pytest.approx([0.2, 0.05] * 200)
    assert s.time[0, 1:][2::2] - s.time[0, 1] == pytest.approx(np.arange(1, 201) / rate)
    assert np.array_equal(s.angle[:, 2::2], s.angle[:, 3::2])
    reached = joint_from_motor(s.angle[:, 3::2, :9]) / amplitude
    assert reached == pytest.approx(u[:, 1:], abs=1e-12)
    assert np.array_equal(s.angle[..., 8], s.angle[..., 9])
    velocity = np.diff(s.angle, axis=1) / np.diff(s.time)[..., None]
    assert np.abs(velocity).max() < drive.LIMITS.velocity
    check_inputs(reached.reshape(-1, 9), 3, (8, 3, 1))
    ends = np.stack([-np.ones(9), np.ones(9)])[None] * 0.0705
    fastest = np.diff(drive.motors_of(ends, rate).angle, axis=1).max() / 0.2
    assert 0.99 < fastest / drive.LIMITS.velocity < 1


def test_angles_read_at_the_end_of_a_hold_are_the_present_inputs_alone():
    runs = body.simulate(POINT, QUICK)
    found = memory(runs.read[..., :10], runs.inputs, 6, QUICK.washout, coarsest=10)
    assert found.profile[:, 0] == pytest.approx(1, abs=0.01)
    assert found.profile[:, 1:].max() < 0.2
    assert np.array_equal(runs.motion.motor_angle[:1], runs.replica.motor_angle)
    assert np.abs(runs.motion.joint_angle[:1, 0] - runs.replica.joint_angle[:, 0]).max() > 1e-4


def test_an_arm_that_rests_carries_the_loads_of_inverse_dynamics():
    smooth = {"strand_slack": 0.0, "joint_friction": 0.0, "joint_damping": 0.05}
    targets = np.repeat(0.25 * np.random.default_rng(0).uniform(-1, 1, (6, 1, 9)), 4, axis=1)
    soft = drive.drive(TwinModel(replace(NOMINAL, **smooth)), targets, 0.2)
    assert soft.load[:, -1] == pytest.approx(rigid.loads(soft.joint_angle[:, -1]), abs=1e-4)
    assert soft.load.std() > 0.03
    stiff = drive.drive(TwinModel(replace(NOMINAL, strand_stiffness=1e6, **smooth)), targets, 0.2)
    exact = rigid.move(targets)
    assert stiff.load[:, -1] == pytest.approx(exact.load[:, -1], abs=5e-3)
    assert stiff.marker[:, -1] == pytest.approx(exact.marker[:, -1], abs=5e-3)
    assert np.array_equal(exact.marker, markers(targets[:, 1:]))


def test_the_rigid_arm_remembers_nothing():
    point, measuring = replace(POINT, stiffness=None, steps=4000), replace(QUICK, coarsest=0.1)
    runs = body.simulate(point, measuring)
    for states in (runs.motion.load, runs.read, runs.motion.joint_angle):
        found = capacities(states, runs.inputs, 2, (4, 2), measuring.washout)
        assert {delay for product in found.products for _, delay, _ in product} == {0}
    about = json.loads(measured(point, measuring).text)
    assert about["body"]["channels"]["both"]["beyond_taps"]["total"] == 0
    assert about["body"]["contraction_rate_per_s"] is None  # at once
    assert about["body"]["markers"]["explained"] == pytest.approx(1, abs=0.02)
    assert about["body"]["channels"]["angles"]["generalisation_rank"] == 0
    assert about["pose"] is None and about["point"]["strand_stiffness_n_per_m"] is None


def test_overlap_is_the_share_of_the_markers_that_states_hold():
    u = np.random.default_rng(0).uniform(-1, 1, (20, 500, 2))
    line = taps(u, 3)
    remembered, product = line[..., 2:3], np.sqrt(3) * u[..., :1] * u[..., 1:]
    sought = expand(remembered + product, u, 2, (3, 2))
    assert overlap(sought, capacities(line, u, 2, (3, 2))) == pytest.approx(0.5, abs=0.03)
    assert overlap(sought, capacities(u, u, 2, (3, 2))) == 0
    both = np.concatenate([line, product], axis=-1)
    assert overlap(sought, capacities(both, u, 2, (3, 2))) == pytest.approx(1, abs=0.05)


def test_pose_errors_alone_are_those_of_the_whole_point():
    alone = json.loads(measured(POINT, replace(QUICK, body=False)).text)
    whole = json.loads(measured(POINT, QUICK).text)
    assert alone["body"] is None and not alone["failed"]
    assert alone["pose"] == whole["pose"]


def test_noise_of_the_loads_changes_what_is_read_and_nothing_else():
    quiet, noisy = (
        body.simulate(replace(POINT, load_noise=noise), QUICK) for noise in (0.004, 0.05)
    )
    assert np.array_equal(quiet.motion.load, noisy.motion.load)
    for runs, noise in ((quiet, 0.004), (noisy, 0.05)):
        added = runs.read[..., 10:] - runs.motion.load
        assert added.std() == pytest.approx(noise, rel=0.05)


def test_a_session_is_the_one_that_collect_records(tmp_path):
    point = GridPoint(
        NOMINAL.strand_stiffness, NOMINAL.strand_slack, NOMINAL.joint_damping, 4, 0.07, 5, 1
    )
    config = Collect(tmp_path / "logs", sessions=1, steps=30, seed=5)
    config.out.mkdir()
    logged = read_session(simulate_session(config, 1, lambda rows: None))
    mine = pose.session(point, replace(QUICK, session_steps=30), 1)
    for name in FIELDS:
        assert np.array_equal(getattr(mine, name), getattr(logged, name)), name


def test_files_hold_six_digits_and_no_rounding_errors():
    value = {"a": np.array([1 / 3, np.nan, -7e-15]), "b": (np.int64(3), True, None, "x")}
    assert json.dumps(rounded(value)) == '{"a": [0.333333, null, 0.0], "b": [3, true, null, "x"]}'


def test_the_command_explains_itself_and_refuses_by_a_sentence(tmp_path):
    command = partial(typed, "serpent_twin.sweep")
    told = command("--help")
    assert "usage: python -m serpent_twin.sweep" in told.stdout and "--config." not in told.stdout
    refused = command(
        "--out", str(tmp_path / "out"), "--rate", "1", "8", "--amplitude", "0.05", "0.06"
    )
    assert refused.returncode == 1
    assert refused.stderr.startswith(
        "error: Targets of ± 0.05 rad at 8 Hz may ask 9.0 rad/s of motor 9"
    )
