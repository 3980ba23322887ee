"""Test what a trace finds in motions of machines that a machine.toml describes."""

import moving_models
import numpy as np
import pytest
from example import assert_named_alone, opened

from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.clocks import clocks_of


def test_a_model_of_a_moving_machine_predicts_its_motion(tmp_path):
    case, pieces, at = moving_models.opened(tmp_path, 0)
    assert pieces.time.shape == (4, 112)  # 97 rows, after a lead of 15
    off = pieces.measured - case.machine.respond([at], pieces)[0]
    assert np.sqrt(np.nanmean(off**2)) < 6e-4  # rad: hardly more than the noise of 5e-4


def test_logs_whose_clocks_begin_anew_follow_each_other_by_the_number_in_their_names(tmp_path):
    rig = open_machine(moving_models.machine(tmp_path))
    folder = tmp_path / "logs"
    for n in (2, 10, 1):
        log = moving_models.log(folder / f"run_{n}.csv", n)
    recordings = rig.read(folder)
    assert [each.name for each in recordings] == ["run_1", "run_2", "run_10"]
    took = recordings[0].time[-1] - recordings[0].time[0]
    pieces = rig.open(recordings).pieces(recordings)
    first = [pieces.session.index(each.name) for each in recordings]
    prior = clocks_of(pieces).prior_runtime[first]
    assert prior == pytest.approx([0.0, took, 2.0 * took])
    alone = rig.read(log)
    assert clocks_of(rig.open(alone).pieces(alone)).prior_runtime == pytest.approx(0.0)


@pytest.mark.parametrize("later", [0, 1])
def test_sessions_of_one_clock_are_as_far_apart_as_it_says_whatever_their_names(later, tmp_path):
    rig = open_machine(moving_models.machine(tmp_path))
    for n in range(2):
        log = moving_models.log(tmp_path / "logs" / f"run_{n}.csv", n)
        if n == later:
            head, *rows = log.read_text().splitlines()
            at = head.split(",").index("t")
            cells = [row.split(",") for row in rows]
            for row in cells:
                row[at] = str(float(row[at]) + 500.0)
            log.write_text("\n".join([head, *map(",".join, cells)]))
    recordings = rig.read(log.parent)
    pieces = rig.open(recordings).pieces(recordings)
    prior = clocks_of(pieces).prior_runtime
    assert prior[[0, -1]] == pytest.approx([500.0, 0.0][:: 1 if later == 0 else -1])


def test_noise_is_estimated_from_a_motion(tmp_path):
    path = moving_models.machine(tmp_path)
    path.write_text(moving_models.TOML.replace("noise = 0.0005", ""))
    case, *_ = opened(path, moving_models.log(tmp_path / "log.csv", 0))
    least = [each.noise for each in case.machine.outputs]
    assert least == pytest.approx([5e-4, 5e-4], rel=0.15)  # rad


@pytest.mark.slow
def test_nothing_is_missing_in_a_motion_where_nothing_is(tmp_path):
    found = moving_models.EXAMPLE.traced(tmp_path, 4)
    assert found["effects"] == [] and not found["unexplained"]["is"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lacks", "name", "parameter"),
    [("friction", "hinge_friction@elbow", "coulomb"), ("late", "command_delay", "delay")],
)
def test_what_a_motion_shows_is_named_with_its_place_and_size(tmp_path, lacks, name, parameter):
    found = moving_models.EXAMPLE.traced(tmp_path, 4, **{lacks: 0.03})
    assert_named_alone(found, name, parameter, 0.03)
