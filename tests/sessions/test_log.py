"""Test that a session log holds what was written, and that an unusable file is refused."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from paths import DATA
from session_log import METADATA, assert_same, full_disk, make_session, write_journal

from serpent_twin import sessions
from serpent_twin.errors import SerpentError

LOGS = DATA / "arm_a"


def edit(path: Path, change) -> None:
    """Rewrite a Parquet file after `change` (table → table)."""
    pq.write_table(change(pq.read_table(path)), path)


def with_metadata(**changes):
    def change(table: pa.Table) -> pa.Table:
        metadata = json.loads(table.schema.metadata[b"serpent_twin"]) | changes
        return table.replace_schema_metadata({"serpent_twin": json.dumps(metadata)})

    return change


def with_column(name: str, values: np.ndarray):
    def change(table: pa.Table) -> pa.Table:
        return table.set_column(table.column_names.index(name), name, pa.array(values))

    return change


@pytest.fixture
def sealed(tmp_path: Path) -> Path:
    return sessions.write_session(tmp_path / "session_01.parquet", make_session())


def test_a_written_session_is_read_back_exactly(tmp_path):
    session = make_session()
    session = session.having(voltage=np.linspace(11, 12, len(session)))
    path = sessions.write_session(tmp_path / "session_04.parquet", session)
    back = sessions.read_session(path)
    assert_same(session, back)
    assert (back.path, back.name, back.rate_hz, len(back)) == (path, "session_04", 4.0, 60)
    assert back.metadata == session.metadata | {"rows": 60}
    assert back.marker.shape == (60, 9, 3)
    assert pq.read_schema(path).field("marker2_y").metadata == {b"unit": b"m"}
    assert set(pq.read_schema(path).types) == {pa.float64()}


def test_columns_are_those_of_logs_from_elsewhere():
    if not LOGS.is_dir():
        pytest.skip(f"{LOGS} is absent")
    path = LOGS / "session_01.parquet"
    assert tuple(pq.read_schema(path).names) == sessions.COLUMNS
    session, table = sessions.read_session(path), pq.read_table(path)
    np.testing.assert_array_equal(session.marker[:, 6, 1], table["marker7_y"].to_numpy())
    np.testing.assert_array_equal(session.motor_load[:, 9], table["motor10_load"].to_numpy())
    assert not [
        f for s in sessions.read_folder(LOGS) for f in sessions.examine(s) if f.level != "note"
    ]


def test_rows_of_a_session_are_views_of_it():
    session = make_session()
    part = session[10:20]
    assert len(part) == 10
    assert part.time[0] == session.time[10]
    assert part.marker.base is not None and np.shares_memory(part.marker, session.marker)


def test_nothing_is_overwritten(sealed):
    before = sealed.read_bytes()
    with pytest.raises(SerpentError, match="exists already"):
        sessions.write_session(sealed, make_session(seed=1))
    with pytest.raises(SerpentError, match="exists already"):
        sessions.Journal(sealed, METADATA)
    assert sealed.read_bytes() == before


def test_a_full_disk_leaves_no_half_file(sealed):
    before = sealed.read_bytes()
    other = sealed.with_name("session_02.parquet")
    with pytest.raises(OSError) as refused, full_disk(4096):
        sessions.write_session(other, make_session(seed=1))
    assert refused.value.filename == str(other)
    assert [p.name for p in sealed.parent.iterdir()] == [sealed.name]
    assert sealed.read_bytes() == before


CLOCK = make_session().time
REFUSALS = {
    "no column": (lambda t: t.drop_columns(["marker3_x", "joint9_target"]), "marker3_x"),
    "other type": (lambda t: with_column("motor4_load", np.arange(60))(t), "motor4_load.*int64"),
    "no rows": (lambda t: t.slice(0, 0), "no rows"),
    "time back": (lambda t: with_column("time", np.r_[CLOCK[:30], CLOCK[:30]])(t), "at row 30"),
    "time nan": (lambda t: with_column("time", np.r_[np.nan, CLOCK[1:]])(t), "time"),
    "other rate": (with_metadata(rate_hz=5.0), "claims rate_hz 5.*4 Hz"),
    "no rate": (with_metadata(rate_hz=None), "rate_hz is null; it must be a number from 0.001"),
    "newer": (with_metadata(schema_version=2), "schema_version is 2; it must be 1"),
    "no metadata": (lambda t: t.replace_schema_metadata(None), "no metadata"),
    "no object": (
        lambda t: t.replace_schema_metadata({"serpent_twin": "[1]"}),
        "metadata: it is a list",
    ),
    "no JSON": (lambda t: t.replace_schema_metadata({"serpent_twin": "{"}), "not JSON"),
    "no arm": (lambda t: t.replace_schema_metadata({"serpent_twin": "{}"}), "lack.*arm"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_read_refuses_and_says_why_and_where(sealed, case):
    change, says = REFUSALS[case]
    edit(sealed, change)
    with pytest.raises(SerpentError, match=says) as refused:
        sessions.read_session(sealed)
    assert str(sealed) in str(refused.value)


@pytest.mark.parametrize("damage", ["torn", "text", "changed"])
def test_read_refuses_a_damaged_file(sealed, damage):
    data = bytearray(sealed.read_bytes())
    changed = data.copy()
    changed[len(data) // 3] ^= 0x10
    sealed.write_bytes(
        {"torn": data[: len(data) // 2], "text": b"a,b\n", "changed": changed}[damage]
    )
    with pytest.raises(SerpentError, match="torn, damaged") as refused:
        sessions.read_session(sealed)
    assert str(sealed) in str(refused.value)


def test_a_folder_is_read_in_the_order_of_its_numbers(tmp_path):
    for number in (10, 2, 1, 100):
        session = make_session(seed=number, session=number)
        sessions.write_session(tmp_path / f"session_{number:02d}.parquet", session)
    (tmp_path / "notes.txt").write_text("not a session")
    assert [s.metadata["session"] for s in sessions.read_folder(tmp_path)] == [1, 2, 10, 100]


@pytest.mark.parametrize(("key", "value"), [("arm", "other"), ("rate_hz", 4.1)])
def test_a_folder_of_mixed_runs_is_refused(sealed, key, value):
    sessions.write_session(sealed.with_name("session_02.parquet"), make_session(**{key: value}))
    with pytest.raises(SerpentError, match=f"differ in {key}.*session_01.*session_02"):
        sessions.read_folder(sealed.parent)


def test_an_empty_or_absent_folder_is_refused_and_a_journal_mentioned(tmp_path, caplog):
    with pytest.raises(SerpentError, match="no folder"):
        sessions.read_folder(tmp_path / "absent")
    with pytest.raises(SerpentError, match="no session_NN"):
        sessions.read_folder(tmp_path)
    write_journal(tmp_path, make_session())
    with pytest.raises(SerpentError, match="log recover"):
        sessions.read_folder(tmp_path)
    sessions.write_session(tmp_path / "session_02.parquet", make_session())
    sessions.read_folder(tmp_path)
    assert "session_01.journal" in caplog.text
