"""Test that the clock of a recording is read in its unit, or refused with what to state."""

import numpy as np
import pytest
from recordings import ANGLE, TABLE, TIME, angle, imported, table

from serpent_twin.errors import SerpentError

DEGREES = np.degrees(ANGLE)


@pytest.mark.parametrize(
    ("stamps", "stated"),
    [
        (1e3 * TIME, 'time_unit = "ms"'),
        ((1.74e18 + 1e9 * TIME).astype(np.int64), ""),
        ((1.74e15 + 1e6 * TIME).astype(np.int64), ""),
        ((1.74e12 + 1e3 * TIME).astype(np.int64), ""),
        (1.74e9 + TIME, ""),
        (np.datetime64("2025-03-02T10:00:20", "ns") + (1e9 * TIME).astype("m8[ns]"), ""),
        ([f"{each:.2f} sec" for each in TIME], ""),
    ],
)
def test_stamps_are_read_in_seconds(tmp_path, stamps, stated):
    _, log = imported(
        tmp_path, [table(tmp_path / "run.csv", t=stamps, q=DEGREES)], TABLE.format(stated)
    )
    np.testing.assert_allclose(log["time"], TIME, atol=1e-6)
    np.testing.assert_allclose(log["elbow"], ANGLE, atol=1e-5)


@pytest.mark.parametrize(
    ("stamps", "head", "stated", "said"),
    [
        (1e3 * TIME, "rate_hz = 100\n", "", r'20 s apart. If it is in another unit, add time_unit = "ms"'),
        ((5e9 + 1e6 * TIME).astype(int), "", "", 'add time_unit = "µs"'),
        (np.arange(len(TIME)), "", "", "counts rows: name a field that is a time"),
        (1e3 * TIME, "rate_hz = 100\n", 'time_unit = "s"', "598,001 rows of 300 messages.*time_unit"),
        (1.74e12 + 1e3 * TIME, "", 'time_unit = "s"', "would last"),
        (np.r_[TIME[:150], TIME[:150]], "", "", "goes back by 2.98 s, first in row 151.*Split"),
        (np.zeros(len(TIME)), "", "", "is 0 in every row"),
        (20 * TIME, "rate_hz = 50\n", 'time_unit = "s"\nhold = false', "greater gap"),
    ],
)  # fmt: skip
def test_a_clock_that_cannot_be_is_refused_with_what_to_state(tmp_path, stamps, head, stated, said):
    """Milliseconds that were taken for seconds made millions of rows, of which nothing was known."""
    file = table(tmp_path / "run.csv", t=stamps, q=DEGREES)
    with pytest.raises(SerpentError, match=said):
        imported(tmp_path, [file], head + TABLE.format(stated))
    assert not list((tmp_path / "out").glob("*.parquet"))


def test_a_unit_that_is_stated_is_no_guess(tmp_path):
    """Poses may be as far apart as a wrong unit would put the rows of a motion."""
    file = table(tmp_path / "run.csv", t=20 * np.arange(30.0), q=DEGREES[:30])
    _, log = imported(tmp_path, [file], TABLE.format('time_unit = "s"'))
    np.testing.assert_allclose(np.diff(log["time"]), 20.0)


def test_rows_that_share_a_stamp_of_a_coarse_clock_are_kept(tmp_path):
    coarse = np.floor(TIME * 10 + 1e-9) / 10
    found, log = imported(
        tmp_path, [table(tmp_path / "run.csv", t=coarse, q=DEGREES)], TABLE.format("")
    )
    assert len(log["time"]) == len(TIME)
    np.testing.assert_allclose(log["time"], TIME, atol=2e-3)
    np.testing.assert_allclose(log["elbow"], ANGLE, atol=1e-12)
    assert "steps by 0.1 s" in found[0].streams[0].notes[0]


def test_a_clock_coarser_than_some_rows_loses_none(tmp_path):
    """Ticks of 1/64 s at 100 Hz: every third row shares a stamp."""
    time = np.arange(0.0, 6.0, 0.01)
    file = table(tmp_path / "run.csv", t=np.floor(time * 64) / 64, q=np.degrees(angle(time)))
    _, log = imported(tmp_path, [file], TABLE.format(""))
    np.testing.assert_allclose(log["time"], time, atol=2e-3)
    np.testing.assert_allclose(log["elbow"], angle(time), atol=1e-9)


def test_rows_that_are_repeated_are_left_out(tmp_path):
    twice = np.repeat(np.arange(len(TIME)), np.where(np.arange(len(TIME)) % 3, 1, 2))
    file = table(tmp_path / "run.csv", t=TIME[twice], q=DEGREES[twice])
    found, log = imported(tmp_path, [file], TABLE.format(""))
    np.testing.assert_allclose(log["elbow"], ANGLE, atol=1e-9)
    assert found[0].streams[0].unsorted == 100


def test_the_last_row_at_a_rate_is_known(tmp_path):
    """Stamps since 1970 are rounded to some 1e-7 s, which is not the end of the recording."""
    file = table(tmp_path / "run.csv", t=1.74e9 + TIME, q=DEGREES)
    _, log = imported(tmp_path, [file], "rate_hz = 50\n" + TABLE.format(""))
    assert len(log["time"]) >= len(TIME) - 1 and np.isfinite(log["elbow"]).all()
    np.testing.assert_allclose(log["elbow"], angle(log["time"]), atol=1e-5)
