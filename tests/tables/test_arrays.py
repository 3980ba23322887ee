"""Test that tables in files of arrays, lists and records are read as columns."""

import json
from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from serpent_twin import tables
from serpent_twin.errors import SerpentError

T = np.arange(12) * 0.02
U = np.stack([np.sin(T), np.cos(T)], axis=1)


def test_npz_has_columns_by_name_plain_and_compressed(tmp_path):
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "run.npz", t=T, u=U, q=T[:, None], rate=50.0, other=np.arange(3))
        found = tables.read(tmp_path / "run.npz")
        assert list(found.columns) == ["t", "u[0]", "u[1]", "q"]
        np.testing.assert_array_equal(found.numbers("u[1]"), U[:, 1])
        with pytest.raises(SerpentError, match="'other' has 3 values, the columns 12"):
            found.numbers("other")


def test_pickles_are_not_read(tmp_path):
    np.savez(tmp_path / "run.npz", t=np.array([{}], dtype=object))
    with pytest.raises(SerpentError, match="no arrays of numbers"):
        tables.read(tmp_path / "run.npz")


def test_matlab_files_have_columns_by_name_and_structs_by_field(tmp_path):
    savemat(tmp_path / "run.mat", {"t": T, "log": {"u": U, "q": T[:, None]}, "rate": 50.0})
    found = tables.read(tmp_path / "run.mat")
    assert list(found.columns) == ["t", "log.u[0]", "log.u[1]", "log.q"]
    np.testing.assert_array_equal(found.numbers("log.q"), T)


def test_a_newer_matlab_file_says_how_to_save_it(tmp_path):
    (tmp_path / "run.mat").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(600))
    with pytest.raises(SerpentError, match=r"version 7\.3, which is HDF5 .* '-v7'"):
        tables.read(tmp_path / "run.mat")


def test_lines_of_json_have_columns_and_a_last_one_may_be_cut_off(tmp_path):
    rows = [{"t": t, "u": u.tolist(), "pose": {"x": 1}} for t, u in zip(T, U, strict=True)]
    del rows[3]["u"]
    text = "\n".join(map(json.dumps, rows))
    (tmp_path / "run.jsonl").write_text(text + '\n{"t": 0.3, "u"')
    found = tables.read(tmp_path / "run.jsonl")
    assert list(found.columns) == ["t", "u[0]", "u[1]", "pose.x"] and "cut off" in found.notes[0]
    assert np.flatnonzero(np.isnan(found.numbers("u[0]"))).tolist() == [3]


def test_parquet_has_lists_records_time_stamps_and_units(tmp_path):
    begin = datetime(2025, 3, 2, 10, tzinfo=UTC)
    columns = {
        "t": pa.array([begin + timedelta(seconds=t) for t in T], pa.timestamp("ns")),
        "zone": pa.array(
            [begin + timedelta(seconds=t) for t in T], pa.timestamp("us", "Europe/Zurich")
        ),
        "u": pa.array(U.tolist()),
        "fixed": pa.array(U.tolist(), pa.list_(pa.float32(), 2)),
        "pose": pa.array([{"x": t, "more": [t]} for t in T]),
        "image": pa.array([b"x"] * len(T)),
        "kind": pa.array(["a"] * len(T)).dictionary_encode(),
        "q": pa.array(T),
    }
    fields = [
        pa.field(n, v.type, metadata={"unit": "rad"} if n == "q" else None)
        for n, v in columns.items()
    ]
    pq.write_table(
        pa.Table.from_arrays([*columns.values()], schema=pa.schema(fields)), tmp_path / "r.parquet"
    )
    found = tables.read(tmp_path / "r.parquet")
    assert found.units == {"q": "rad"} and "image" not in found
    for name in ("t", "zone"):
        np.testing.assert_allclose(found.seconds(name) - begin.timestamp(), T, atol=1e-6)
    for name in ("u", "fixed"):
        np.testing.assert_allclose(found.numbers(f"{name}[1]"), U[:, 1], rtol=1e-6)
    np.testing.assert_array_equal(found.numbers("pose.x"), T)
    np.testing.assert_array_equal(found.numbers("pose.more"), T)  # lists of one number
    with pytest.raises(SerpentError, match="'u' holds lists: name one of"):
        found.numbers("u")


def test_lists_of_different_lengths_leave_cells_empty(tmp_path):
    pq.write_table(
        pa.table({"u": [[1.0, 2.0], [3.0], None, [], [4.0, 5.0]]}), tmp_path / "r.parquet"
    )
    found = tables.read(tmp_path / "r.parquet")
    np.testing.assert_array_equal(found.numbers("u[0]"), [1, 3, np.nan, np.nan, 4])
    np.testing.assert_array_equal(found.numbers("u[1]"), [2, np.nan, np.nan, np.nan, 5])


def test_numbers_of_a_data_set_have_the_names_that_it_gives(tmp_path):
    about = {
        "features": {
            "action": {"names": ["pan", "lift"]},
            "state": {"names": {"motors": ["pan", "lift"]}},
        }
    }
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text(json.dumps(about))
    (tmp_path / "data" / "chunk-000").mkdir(parents=True)
    path = tmp_path / "data" / "chunk-000" / "episode_000000.parquet"
    pq.write_table(pa.table({"action": U.tolist(), "state": (2 * U).tolist()}), path)
    found = tables.read(path)
    np.testing.assert_array_equal(found.numbers("action.lift"), U[:, 1])
    np.testing.assert_array_equal(found.numbers("state.pan"), 2 * U[:, 0])


@pytest.mark.parametrize(
    "name, said",
    [("a.xlsx", "as CSV"), ("a.h5", "HDF5"), ("a.mcap", "log import"), ("a.md", "no table")],
)
def test_other_files_are_refused_with_a_way_out(tmp_path, name, said):
    with pytest.raises(SerpentError, match=said):
        tables.read(tmp_path / name)
