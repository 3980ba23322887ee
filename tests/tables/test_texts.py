"""Test that tables in texts are read as loggers and spreadsheets write them, and that others say why not."""

import gzip

import numpy as np
import pytest

from serpent_twin import tables
from serpent_twin.errors import SerpentError

WRITTEN = {
    "commas": "t,angle\n0,0.5\n1,-1.25\n",
    "blanks after commas": "t, angle\n0, 0.5\n1, -1.25\n",
    "quoted": '"t", "angle"\n0, 0.5\n1, -1.25\n',
    "quoted cells": '"t","angle"\n"0","0.5"\n"1","-1.25"\n',
    "tabs": "t\tangle\n0\t0.5\n1\t-1.25\n",
    "semicolons": "t;angle\n0;0.5\n1;-1.25\n",
    "decimal commas": "t;angle\n0;0,5\n1;-1,25\n",
    "blanks": "t angle\n0    0.5\n1  -1.25\n",
    "aligned": "   t   angle\n   0     0.5\n   1   -1.25\n",
    "byte order mark": "\ufefft,angle\n0,0.5\n1,-1.25\n",
    "comments": "# robot: arm\n# rate: 50 Hz, or so\nt,angle\n0,0.5\n1,-1.25\n",
    "a header that is a comment": "# t,angle\n0,0.5\n1,-1.25\n",
    "per cent comments": "% made by a script\nt,angle\n0,0.5\n1,-1.25\n",
    "a title and an empty line": "Run of Monday\n\nt,angle\n0,0.5\n1,-1.25\n",
    "pairs above the header": "Logger,2\nDate,2025/03/02\nTime,10:00:20\n\nt,angle\n0,0.5\n1,-1.25\n",
    "comments between rows": "t,angle\n0,0.5\n# a knock was heard\n1,-1.25\n",
    "Windows line ends": "t,angle\r\n0,0.5\r\n1,-1.25\r\n",
    "no last line end": "t,angle\n0,0.5\n1,-1.25",
    "a comma at each end": "t,angle,\n0,0.5,\n1,-1.25,\n",
    "a comma at each row's end": "t,angle\n0,0.5,\n1,-1.25,\n",
    "an index": ",t,angle\n0,0,0.5\n1,1,-1.25\n",
    "units under names": "t,angle\n[s],[rad]\n0,0.5\n1,-1.25\n",
    "whole numbers first": "t,angle\n" + "0,0\n" * 400_000 + "0,0.5\n1,-1.25\n",
}


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN)
def test_a_text_is_read_however_it_is_written(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8", newline="")
    found = tables.read(path)
    assert list(found.columns) == ["t", "angle"] and not found.notes
    np.testing.assert_array_equal(found.numbers("angle")[-2:], [0.5, -1.25])


@pytest.mark.parametrize("name", ["log.CSV", "log.tsv", "log.txt", "log.csv.gz", "LOG.CSV.GZ"])
def test_names_of_any_case_and_compressed_texts_are_read(tmp_path, name):
    raw = WRITTEN["commas"].encode()
    (tmp_path / name).write_bytes(gzip.compress(raw) if name.lower().endswith("gz") else raw)
    assert tables.reads(tmp_path / name)
    assert tables.read(tmp_path / name).rows == 2


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_other_encodings_are_read(tmp_path, encoding):
    path = tmp_path / "log.csv"
    path.write_text("t,angle °\n0,0.5\n1,-1.25\n", encoding=encoding)
    assert list(tables.read(path).columns) == ["t", "angle °"]


def test_units_under_the_names_are_kept(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,angle\nms,deg\n0,0.5\n1,-1.25\n")
    assert tables.read(path).units == {"t": "ms", "angle": "deg"}


@pytest.mark.parametrize(
    "end",
    [
        "0.040000,0.1",
        "0.040000",
        "0.040000,0.053886,0.",
        "0.040000,0.053886,0.20",
        "0.040000,0.053886,-",
    ],
)
def test_a_last_row_that_is_cut_off_is_left_out_and_that_is_said(tmp_path, end):
    path = tmp_path / "log.csv"
    path.write_text("t,u,q\n0.000000,0.068916,0.205054\n0.020000,0.068916,0.205054\n" + end)
    found = tables.read(path)
    assert found.rows == 2 and found.notes == ("its last row is cut off, and left out",)
    assert found.numbers("q").tolist() == [0.205054, 0.205054]


def test_a_compressed_text_that_is_cut_off_is_read_as_far_as_it_goes(tmp_path):
    path = tmp_path / "log.csv.gz"
    rows = "".join(f"{n},{n * n % 977}\n" for n in range(5000))
    path.write_bytes(gzip.compress(("t,q\n" + rows).encode())[:-2000])
    found = tables.read(path)
    assert 100 < found.rows < 5000 and "cut off" in found.notes[0]
    np.testing.assert_array_equal(found.numbers("q"), np.arange(found.rows) ** 2 % 977)


REFUSED = {
    "0.1,0.2\n0.3,0.4\n": "there is no header line. Write a first line",
    "t,q\n": "no row of numbers under a header",
    "": "it is empty",
    "t,q,again\n0,1\n1,2\n": "names 3 columns, and the row under it has 2",
    "t,q\n0,1\n1\n2,3\n": "line 3 has 1 cell where the header names 2 columns",
    "t,q,q\n0,1,2\n": "two columns of one name: q",
}


@pytest.mark.parametrize(("text", "wanted"), REFUSED.items())
def test_what_is_no_table_is_refused_with_the_reason(tmp_path, text, wanted):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(SerpentError) as error:
        tables.read(path, "Leave it out.")
    assert wanted in str(error.value) and str(path) in str(error.value)


def test_texts_among_numbers_are_named_by_row(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q\n0,1\n1,lost\n2,3\n")
    with pytest.raises(SerpentError, match="'q' holds 'lost' in row 2, not numbers"):
        tables.read(path).numbers("q")


TIMES = {
    "seconds": ["0.00", "0.02", "0.04"],
    "as MATLAB writes timetables": ["0.00 sec", "0.02 sec", "0.04 sec"],
    "milliseconds": ["0 ms", "20 ms", "40 ms"],
    "ISO": ["2025-03-02T10:00:20", "2025-03-02T10:00:20.02", "2025-03-02T10:00:20.04"],
    "as pandas writes": [
        "2025-03-02 10:00:20+00:00",
        "2025-03-02 10:00:20.020000+00:00",
        "2025-03-02 10:00:20.040000+00:00",
    ],
    "Zulu": ["2025-03-02T10:00:20Z", "2025-03-02T10:00:20.02Z", "2025-03-02T10:00:20.04Z"],
    "nanoseconds": [
        "2025-03-02T10:00:20.000000000",
        "2025-03-02T10:00:20.020000000",
        "2025-03-02T10:00:20.040000000",
    ],
    "MATLAB datetime": [
        "02-Mar-2025 10:00:20.00",
        "02-Mar-2025 10:00:20.02",
        "02-Mar-2025 10:00:20.04",
    ],
    "time of day": ["10:00:20.00", "10:00:20.02", "10:00:20.04"],
    "past midnight": ["23:59:59.98", "00:00:00.00", "00:00:00.02"],
    "timedelta": ["0 days 00:00:00", "0 days 00:00:00.020000", "0 days 00:00:00.040000"],
}


@pytest.mark.parametrize("cells", TIMES.values(), ids=TIMES)
def test_times_are_read_however_they_are_written(tmp_path, cells):
    path = tmp_path / "log.csv"
    path.write_text("t,q\n" + "".join(f"{cell},{n}\n" for n, cell in enumerate(cells)))
    found = tables.read(path).seconds("t")
    np.testing.assert_allclose(found - found[0], [0, 0.02, 0.04], atol=1e-6)


def test_a_time_that_is_none_is_named(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q\n0.1,0\nnoon,1\n")
    with pytest.raises(SerpentError, match="'t' holds 'noon' in row 2, which is no time"):
        tables.read(path).seconds("t")
