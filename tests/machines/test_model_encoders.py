"""Test what is put right of angles that wrap and of readings that repeat, and what is said of starts."""

import numpy as np
import own_models
import pytest

from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.encoders import NOTES

LSB = 2 * np.pi / 4096  # [rad], of a usual encoder


def sessions(tmp_path, name, change=None, toml=None):
    """The sessions of a small model, a column of which is changed in the file."""
    path = own_models.write(tmp_path, name, sessions=1)
    log = path.parent / "logs" / "run_0.csv"
    head, table = log.read_text().partition("\n")[0], np.loadtxt(log, delimiter=",", skiprows=1)
    if change:
        table[:, -1] = change(table[:, -1])
    np.savetxt(log, table, "%.9f", ",", header=head, comments="")
    if toml:
        path.write_text(toml(path.read_text()))
    rig = open_machine(path)
    return rig, rig.read(path.parent / "logs"), table


def test_an_angle_that_wraps_goes_on_in_the_turn_of_its_servo(tmp_path):
    _, (run,), table = sessions(tmp_path, "encoder that wraps")
    assert np.ptp(table[:, -1]) > 6  # rad: the file has the jumps
    assert np.abs(np.diff(run.columns["j1"])).max() < 0.2
    np.testing.assert_allclose(run.columns["j1"], run.columns["u_s1"], atol=0.3)
    assert "'j1' jumps by a turn in" in run.metadata[NOTES][0]


def test_a_jump_that_is_no_turn_stays(tmp_path):
    def jumps(angle):
        return angle + 4.5 * (np.arange(len(angle)) > 100)

    _, (run,), table = sessions(tmp_path, "passive joint", jumps)
    np.testing.assert_allclose(run.columns["j1"], table[:, -1])
    assert not run.metadata[NOTES]


@pytest.mark.parametrize("rows", [2, 3, 5])
@pytest.mark.parametrize("resolution", [1e-9, LSB])
def test_readings_that_are_slower_than_rows_count_once(tmp_path, rows, resolution):
    def slow(angle):
        return np.round(angle[np.arange(len(angle)) // rows * rows] / resolution) * resolution

    _, (run,), _ = sessions(tmp_path, "passive joint", slow)
    known = np.isfinite(run.columns["j1"])
    np.testing.assert_array_equal(known, np.arange(len(known)) % rows == 0)
    assert "left out" in run.metadata[NOTES][0]


def test_slow_readings_are_found_among_all_rows_also_where_some_are_used(tmp_path):
    _, (run,), table = sessions(
        tmp_path,
        "passive joint",
        lambda angle: angle[np.arange(len(angle)) // 3 * 3],
        lambda text: text.replace('rows = "motion"', 'rows = "motion"\nevery = 2'),
    )
    known = np.isfinite(run.columns["j1"])
    np.testing.assert_array_equal(known, 2 * np.arange(len(known)) % 3 == 0)
    np.testing.assert_allclose(run.columns["j1"][known], table[::6, -1], atol=1e-9)


@pytest.mark.parametrize("resolution", [LSB, 10 * LSB])
def test_a_coarse_encoder_repeats_nothing(tmp_path, resolution):
    _, (run,), _ = sessions(
        tmp_path, "passive joint", lambda angle: np.round(angle / resolution) * resolution
    )
    assert np.isfinite(run.columns["j1"]).all()


def test_an_encoder_that_rests_between_quick_motions_repeats_nothing(tmp_path):
    def pauses(angle):
        return np.where(np.arange(len(angle)) % 50 < 20, 0.1, angle)

    _, (run,), _ = sessions(tmp_path, "passive joint", pauses)
    assert np.isfinite(run.columns["j1"]).all()


def test_noise_is_estimated_from_the_readings_that_are_left(tmp_path):
    rig, runs, _ = sessions(
        tmp_path,
        "readings slower than rows",
        toml=lambda text: text.replace(f", noise = {own_models.NOISE}", ""),
    )
    noise = [each.noise for each in rig.open(runs).machine.outputs]
    assert all(0.6 < each / own_models.NOISE < 1.8 for each in noise)  # of 68 readings


def test_joints_that_nothing_measures_are_named_and_how_they_begin(tmp_path):
    rig, runs, _ = sessions(tmp_path, "passive joint that swings")
    (note,) = rig.open(runs).notes
    assert note == "Nothing measures p: taken to begin as the first rows say in 1 log."


def test_a_start_that_nothing_explains_is_named_by_log_and_channel(tmp_path):
    """The first readings of an arm beside a cube are off by what no state of either makes."""

    def shaken(angle):
        first = np.arange(len(angle)) < 14
        return angle + first * 0.05 * (-1.0) ** np.arange(len(angle))

    rig, runs, _ = sessions(tmp_path, "free cube beside", shaken)
    notes = rig.open(runs).notes
    assert any("run_0: in 'j1' the nominal model is off by 2.67 °" in note for note in notes)
    assert any("is not known. Begin logs at rest" in note for note in notes)
