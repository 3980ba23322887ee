"""Test that rows are put on the even clock that made them, whatever happened to their stamps."""

import numpy as np
import pytest

from serpent_twin.tables.even import UnevenError, even_rows
from serpent_twin.tables.sampling import between, held, held_cells, is_stream

PERIOD, ROWS = 0.02, 1000
K = np.arange(ROWS)


def signal(time, rng):
    """A motion with a little noise."""
    moved = np.sin(2 * np.pi * 0.7 * time) + 0.3 * np.sin(2 * np.pi * 2 * time)
    return moved + 1e-3 * rng.standard_normal(len(time))


def test_an_even_clock_is_left_as_it_is():
    time = 3.0 + PERIOD * K
    (found,) = even_rows(time, [np.sin(time)])
    np.testing.assert_array_equal(found.time, time)
    np.testing.assert_array_equal(found.row, K)
    assert not found.mended.sentence()


@pytest.mark.parametrize("jitter", [0.0005, 0.002, 0.004])
def test_stamps_that_jitter_about_even_readings_are_put_right(jitter):
    rng = np.random.default_rng(0)
    time = np.sort(PERIOD * K + rng.normal(0, jitter, ROWS))
    (found,) = even_rows(time, [signal(PERIOD * K, rng)])
    assert found.stamp is None and len(found.time) == ROWS
    np.testing.assert_allclose(np.diff(found.time), PERIOD, rtol=1e-4)
    np.testing.assert_allclose(found.mended.jitter, jitter, rtol=0.1)


@pytest.mark.parametrize("jitter", [0.0005, 0.002, 0.004])
def test_readings_at_uneven_times_are_interpolated(jitter):
    rng = np.random.default_rng(0)
    time = np.sort(PERIOD * K + rng.normal(0, jitter, ROWS))
    (found,) = even_rows(time, [signal(time, rng)])
    assert found.stamp is not None
    np.testing.assert_allclose(np.diff(found.time), PERIOD, rtol=1e-3)


def test_a_loop_that_drifts_is_interpolated():
    rng = np.random.default_rng(1)
    time = np.cumsum(0.02 + np.abs(rng.normal(0, 0.002, ROWS)))
    (found,) = even_rows(time, [signal(time, rng)])
    assert found.stamp is not None and abs(found.time[-1] - time[-1]) < PERIOD


def test_lost_and_repeated_rows_are_counted():
    rng = np.random.default_rng(2)
    kept = np.sort(rng.choice(K, ROWS - 60, replace=False))
    kept = np.sort(np.r_[kept, kept[100:500:40]])
    stamps = PERIOD * K + rng.normal(0, 0.001, ROWS)
    (found,) = even_rows(stamps[kept], [signal(PERIOD * K, rng)[kept]])
    ends = kept[-1] - kept[0] + 1
    assert len(found.row) == ends and found.mended.repeated == 10
    assert found.mended.lost == ends - len(set(kept.tolist()))
    there = found.row >= 0
    np.testing.assert_array_equal(kept[found.row[there]], kept[0] + np.flatnonzero(there))


@pytest.mark.parametrize("jitter", [0.0003, 0.002])
@pytest.mark.parametrize("lost", [[512], [150, 480, 820], [90, 300, 500, 710, 930]])
def test_a_few_rows_lost_far_apart_are_found(lost, jitter):
    """Though a slower clock without them passes within a row of all stamps."""
    rng = np.random.default_rng(4)
    kept = np.setdiff1d(K, lost)
    stamps = PERIOD * K + rng.normal(0, jitter, ROWS)
    (found,) = even_rows(stamps[kept], [signal(PERIOD * K, rng)[kept]])
    assert found.stamp is None and found.mended.lost == len(lost)
    np.testing.assert_array_equal(np.flatnonzero(found.row < 0), lost)
    np.testing.assert_allclose(found.time - PERIOD * K, found.time[0], atol=jitter / 2)


@pytest.mark.parametrize("burst", [0.5, 1.2])
def test_rows_that_come_in_bursts_are_all_kept(burst):
    """A buffer of two rows hands them on in bursts: none is lost."""
    rng = np.random.default_rng(5)
    late = np.where(K % 2 == 0, burst * PERIOD, 0.0) + rng.normal(0, 1e-4, ROWS)
    stamps = np.sort(PERIOD * K + late)
    (found,) = even_rows(stamps, [signal(PERIOD * K, rng)])
    assert len(found.row) == ROWS and found.mended.lost == 0


@pytest.mark.parametrize(
    "rate, step", [(50.0, 0.1), (25.0, 0.1), (125.0, 0.01), (60.0, 0.001), (1000.0, 0.015625)]
)
def test_coarse_clocks_are_spread_evenly(rate, step):
    """Coarse clocks are a Windows clock of 1/64 s, or time stamps that are rounded."""
    time = np.floor(K / rate / step) * step
    (found,) = even_rows(time, [signal(K / rate, np.random.default_rng(3))])
    assert len(found.row) == ROWS and (found.row == K).all()
    np.testing.assert_allclose(found.period, 1 / rate, rtol=1e-3)


def test_a_long_gap_splits_the_log():
    time = PERIOD * np.r_[K[:300], K[420:]]
    first, second = even_rows(time, [np.sin(time)])
    assert len(first.row) == 300 and second.row[0] == 300
    np.testing.assert_allclose(second.time[0], 420 * PERIOD)


def test_a_few_rows_out_of_order_are_sorted_and_a_clock_that_goes_back_is_refused():
    time = PERIOD * K
    time[[100, 101]] = time[[101, 100]]
    (found,) = even_rows(time, [np.sin(time)])
    assert found.mended.unsorted == 1 and found.row[100] == 101
    with pytest.raises(UnevenError, match="goes back in row 501"):
        even_rows(PERIOD * (K % 500), [np.sin(K)])
    with pytest.raises(UnevenError, match="stands still"):
        even_rows(np.zeros(50), [np.arange(50.0)])


def test_commands_are_held_and_come_neither_early_nor_late_on_the_whole():
    """The mean of a held signal over each row, by a fine sum."""
    rng = np.random.default_rng(4)
    own = np.cumsum(rng.uniform(0.01, 0.3, 60))
    values = rng.standard_normal(60)
    at = 0.5 + 0.02 * np.arange(300)
    fine = at[:, None] + 0.02 * (np.arange(2000) + 0.5) / 2000
    mean = values[np.searchsorted(own, fine, side="right") - 1].mean(axis=1)
    np.testing.assert_allclose(held(own, values, at, 0.02), mean, atol=3e-3)
    assert np.isnan(held(own, values, np.array([-1.0]), 0.02)).all()


def test_commands_with_a_row_each_are_left_as_they_are():
    values = np.random.default_rng(5).standard_normal(ROWS)
    np.testing.assert_array_equal(held(PERIOD * K, values, PERIOD * K, PERIOD), values)


def test_streams_of_commands_are_told_from_steps():
    rng = np.random.default_rng(6)
    smooth = np.sin(0.1 * K)
    steps, cells = np.repeat(smooth[::5], 5), np.where(K % 5, np.nan, smooth)
    once = np.where(K < 500, 0.0, 1.0)
    lossy = np.where(rng.random(ROWS) < 0.3, np.nan, smooth)
    found = [is_stream(each) for each in (smooth, lossy, steps, cells, once, rng.random(ROWS))]
    assert found == [True, True, False, False, False, False]


def test_empty_cells_hold_and_readings_bridge_short_gaps_only():
    nan = np.nan
    np.testing.assert_array_equal(held_cells(np.array([nan, 1, nan, nan, 2])), [nan, 1, 1, 1, 2])
    time, values = np.array([0.0, 0.1, 0.2, 1.0]), np.array([0.0, 1.0, nan, 10.0])
    np.testing.assert_allclose(
        between(time, values, np.array([0.05, 0.5, 1.0, 2.0]), 0.2), [0.5, nan, 10, nan]
    )
