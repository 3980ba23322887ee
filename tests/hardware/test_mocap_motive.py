"""Test that Motive's files are read correctly."""

import csv

import numpy as np
import pytest
from motive_csv import DIALECTS, write_take
from paths import SHARED

from serpent_twin.errors import SerpentError
from serpent_twin.hardware.motive import read_take

REAL = SHARED / "measured" / "optitrack"


def real(name):
    path = REAL / name
    if not path.exists():
        pytest.skip(f"there is no {path}")
    return path


def test_a_real_export_of_2016_in_metres():
    take = read_take(real("hmv-s16_sample_optitrack_take_BSD3.csv"))
    assert take.rate_hz == 120.0 and len(take.frame) == 250 and np.ptp(take.frame) == 249
    assert take.names[:4] == (
        "Unlabeled:108",
        "Unlabeled:110",
        "Unlabeled:111",
        "Rigid Body 1:Marker1",
    )
    assert take.time[249] == pytest.approx(2.075)
    # read off lines 8 and 9 of the file
    assert take.position[0, 0] == pytest.approx([-0.724127, 0.716956, 2.824065])
    assert take.position[0, 5] == pytest.approx([0.160012, 0.019159, 0.009836])
    assert take.position[1, 3] == pytest.approx([0.009934, 0.019175, 0.009803])
    assert np.isnan(take.position[0, 6:]).all()
    assert take.metadata["Take Name"] == "Take 2016-01-05 03.49.50 PM"


def test_a_real_export_in_centimetres_with_timecode_and_a_wrong_count():
    take = read_take(real("point-tracking-filter_slow2_head_MIT.csv"))
    assert take.metadata["Total Frames in Take"] == "8622" and len(take.frame) == 20
    assert take.names[3] == "Unlabeled 1189" and np.isnan(take.position[:, 3]).all()
    assert take.position[0, 0] == pytest.approx([-0.92003639, 3.11561951, 1.34137253])
    assert take.position[19, 2] == pytest.approx([-0.92011108, 3.13830139, 1.37288254])


def test_a_real_export_without_measured_markers_is_refused_with_advice():
    with pytest.raises(
        SerpentError, match=r"no Marker columns, only Rigid Body, .*Markers switched on"
    ):
        read_take(real("rofunc_take_head_Apache2.csv"))


@pytest.mark.parametrize("dialect", DIALECTS.values(), ids=DIALECTS)
def test_every_dialect_says_the_same(dialect, tmp_path):
    rng = np.random.default_rng(0)
    position = rng.uniform(-3, 3, (50, 3, 3))
    position[rng.random((50, 3)) < 0.2] = np.nan
    frame = np.delete(np.arange(1000, 1055), [3, 4, 5, 30, 31])
    names = ["arm:Marker1", "Unlabeled 7", 'a "quoted" name'.replace('"', "")]
    take = read_take(write_take(tmp_path / "t.csv", frame, names, position, dialect))
    assert take.names == tuple(names)
    assert np.array_equal(take.frame, frame)
    assert take.time == pytest.approx(frame / 120, abs=1e-12)  # not rounded to 1 ms
    assert np.allclose(take.position, position, atol=1e-6, equal_nan=True)


def test_columns_of_one_name_are_joined_unless_both_are_seen_at_once(tmp_path):
    position = np.ones((6, 3, 3)) * np.arange(3)[None, :, None]
    position[:3, 1] = position[3:, 0] = np.nan
    path = write_take(tmp_path / "t.csv", np.arange(6), ["a", "a", "a"], position)
    take = read_take(path)
    assert take.names == ("a", "a (2)")
    assert take.position[:, 0, 0].tolist() == [0, 0, 0, 1, 1, 1]
    assert take.position[:, 1, 2].tolist() == [2] * 6


def changed(path, old, new):
    text = path.read_bytes()
    assert old in text
    path.write_bytes(text.replace(old, new))
    return path


def test_a_file_cut_off_in_its_last_line_loses_that_line_only(tmp_path):
    path = write_take(tmp_path / "t.csv", np.arange(9), ["a", "b"], np.ones((9, 2, 3)))
    path.write_bytes(path.read_bytes()[:-20])
    assert len(read_take(path).frame) == 8


def test_what_is_wrong_with_a_file_is_said(tmp_path):
    def fresh():
        return write_take(tmp_path / "t.csv", np.arange(9), ["a", "b"], np.ones((9, 2, 3)))

    with pytest.raises(SerpentError, match=r"There is no .*t\.csv"):
        read_take(tmp_path / "t.csv")
    with pytest.raises(SerpentError, match=r"length unit is 'Feet'.*meters"):
        read_take(changed(fresh(), b"Millimeters", b"Feet"))
    with pytest.raises(SerpentError, match=r"do not fit the frame rates"):
        read_take(changed(fresh(), b"Frame Rate,120.0", b"Frame Rate,30.0"))
    with pytest.raises(SerpentError, match=r"do not increase at data row 5"):
        read_take(changed(fresh(), b"\n5,", b"\n4,"))
    with pytest.raises(SerpentError, match=r"has 2 cells instead of"):
        read_take(changed(fresh(), b"\n5,", b"\n7,7\r\n5,"))
    with pytest.raises(SerpentError, match=r"not a number"):
        read_take(changed(fresh(), b"1000.000000\r\n5,", b"1000.x\r\n5,"))
    with pytest.raises(SerpentError, match=r"not a Motive export"):
        read_take(changed(fresh(), b"Format Version", b"Other"))
    with pytest.raises(SerpentError, match=r"no row that begins with 'Frame'"):
        read_take(changed(fresh(), b"\nFrame,", b"\nImage,"))
    for garbage in (bytes(range(256)) * 1000, b"x" * 200_000, b"PAR1" + bytes(9), b""):
        (tmp_path / "other.csv").write_bytes(garbage)
        with pytest.raises(SerpentError, match=r"other\.csv is not a Motive export"):
            read_take(tmp_path / "other.csv")
    (tmp_path / "torn.csv").write_bytes(b"Format Version," + b"x" * 200_000)
    with pytest.raises(SerpentError, match=r"torn\.csv: a header row cannot be read"):
        read_take(tmp_path / "torn.csv")
    with (tmp_path / "empty.csv").open("w") as file:
        csv.writer(file).writerow([])
    with pytest.raises(SerpentError, match=r"not a Motive export"):
        read_take(tmp_path / "empty.csv")
