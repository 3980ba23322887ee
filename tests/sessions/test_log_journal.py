"""Test that a journal loses no row, whatever happens to its file or its writer."""

import signal
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pytest
from paths import ROOT
from session_log import METADATA, assert_same, full_disk, make_session, rows_of, write_journal

from serpent_twin import sessions
from serpent_twin.errors import SerpentError


def test_a_sealed_journal_holds_what_was_appended(tmp_path):
    session = make_session()
    with sessions.Journal(tmp_path / "session_01.parquet", METADATA) as journal:
        for row in rows_of(session):
            journal.append(row)
        sealed = journal.seal()
    back = sessions.read_session(sealed)
    assert_same(session, back)
    assert back.metadata == session.metadata | {"complete": True, "rows": 60}
    assert [p.name for p in tmp_path.iterdir()] == ["session_01.parquet"]


def test_a_journal_keeps_further_columns(tmp_path):
    with sessions.Journal(tmp_path / "session_01.journal", METADATA, extra=("voltage",)) as journal:
        for k, row in enumerate(rows_of(make_session())):
            journal.append(row | {"voltage": 12.0 - k / 100})
        back = sessions.read_session(journal.seal())
    np.testing.assert_array_equal(back.extra["voltage"], 12.0 - np.arange(60) / 100)


def test_a_journal_is_an_arrow_stream_that_any_reader_opens(tmp_path):
    session = make_session()
    path, _ = write_journal(tmp_path, session)
    table = pa.ipc.open_stream(path.read_bytes()).read_all()
    rows = table["row"].combine_chunks().flatten().to_numpy().reshape(60, -1)
    np.testing.assert_array_equal(
        rows, np.stack(list(sessions.columns_of(session).values()), axis=1)
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda row: row | {"marker": np.zeros((9, 2))}, "marker has shape"),
        (lambda row: {k: v for k, v in row.items() if k != "motor_load"}, "motor_load"),
        (lambda row: row | {"voltage": 12.0}, "voltage"),
        (lambda row: row | {"time": 0.0}, "is not after"),
        (lambda row: row | {"time": np.nan}, "is not after"),
    ],
)
def test_a_journal_refuses_a_wrong_row_and_goes_on(tmp_path, change, says):
    first, second = rows_of(make_session())[:2]
    with sessions.Journal(tmp_path / "session_01.journal", METADATA) as journal:
        journal.append(first)
        with pytest.raises(SerpentError, match=says):
            journal.append(change(second))
        journal.append(second)
        assert len(sessions.read_session(journal.seal())) == 2


def test_400_truncations_give_exactly_the_whole_rows(tmp_path):
    session = make_session()
    path, sizes = write_journal(tmp_path, session)
    data = path.read_bytes()
    rng = np.random.default_rng(1)
    for length in rng.integers(0, len(data) + 1, 400):
        path.write_bytes(data[:length])
        whole = sum(size <= length for size in sizes[1:])
        content = sessions.read_journal(path)
        assert len(content.rows) == whole
        assert content.bytes_dropped == length - (sizes[whole] if length >= sizes[0] else 0)
        assert whole == 0 or (content.rows[:, 0] == session.time[:whole]).all()


def test_400_changed_bytes_never_pass_for_a_row(tmp_path):
    session = make_session(40)
    path, sizes = write_journal(tmp_path, session)
    data = path.read_bytes()
    expected = np.stack(list(sessions.columns_of(session).values()), axis=1)
    rng = np.random.default_rng(2)
    for at in rng.integers(0, len(data), 400):
        changed = bytearray(data)
        changed[at] ^= int(rng.integers(1, 256))
        path.write_bytes(changed)
        rows = sessions.read_journal(path).rows
        hit = max(0, int(np.searchsorted(sizes, at, side="right")) - 1)
        if at >= sizes[0]:
            assert len(rows) >= hit, "a row before the damage is missing"
            values = data.index(expected[hit].tobytes(), sizes[hit])
            if values <= at < values + expected[hit].nbytes:
                assert len(rows) == hit, "a changed row came back"
        np.testing.assert_array_equal(rows, expected[: len(rows)].reshape(rows.shape))


def test_a_journal_whose_schema_lost_its_columns_holds_no_row(tmp_path):
    path, _ = write_journal(tmp_path, make_session())
    with pa.ipc.open_stream(path.read_bytes()) as stream:
        schema = pa.schema([], metadata=stream.schema.metadata)
    with pa.OSFile(str(path), "wb") as file, pa.ipc.new_stream(file, schema) as out:
        out.write_batch(pa.RecordBatch.from_arrays([], schema=schema))
    assert not len(sessions.read_journal(path).rows)


@pytest.mark.parametrize("order", [[0, 2, 3], [0, 1, 1, 2], [0, 2, 1], [1, 2]])
def test_rows_out_of_order_end_the_readable_part(tmp_path, order):
    path, sizes = write_journal(tmp_path, make_session(4))
    data = path.read_bytes()
    frames = [data[a:b] for a, b in pairwise(sizes)]
    path.write_bytes(data[: sizes[0]] + b"".join(frames[k] for k in order))
    good = next((n for n, k in enumerate(order) if n != k), len(order))
    assert len(sessions.read_journal(path).rows) == good


_RECORDER = """
import sys, json, numpy as np
from serpent_twin import sessions
from tests.shared.session_log import make_session, rows_of, METADATA
with sessions.Journal(sys.argv[1] + "/session_01.journal", METADATA) as journal:
    for row in rows_of(make_session(100000)):
        journal.append(row)
        print(journal.rows, flush=True)
"""


def test_kill_9_loses_no_row(tmp_path):
    command = [sys.executable, "-c", _RECORDER, str(tmp_path)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as recorder:
        assert recorder.stdout is not None
        for _ in range(137):
            logged = int(recorder.stdout.readline())
        with pytest.raises(SerpentError, match="recorded right now"):
            sessions.recover(tmp_path)
        recorder.send_signal(signal.SIGKILL)
        logged = max([logged, *(int(line) for line in recorder.stdout.read().split("\n")[:-1])])
    (sealed,) = sessions.recover(tmp_path)
    session = sessions.read_session(sealed)
    assert logged <= len(session) <= logged + 1
    assert session.metadata["recovered"] and not session.metadata["complete"]
    assert_same(session, make_session(100000)[: len(session)])


def test_recover_keeps_a_torn_journal(tmp_path):
    path, sizes = write_journal(tmp_path, make_session())
    torn = path.read_bytes()[: sizes[30] + 11]
    path.write_bytes(torn)
    (tmp_path / "session_01.journal.torn").write_bytes(b"an older one")
    (sealed,) = sessions.recover(path)
    assert len(sessions.read_session(sealed)) == 30
    assert sessions.read_session(sealed).metadata["bytes_dropped"] == 11
    assert not path.exists()
    assert (tmp_path / "session_01.journal.torn").read_bytes() == b"an older one"
    assert (tmp_path / "session_01.journal.torn2").read_bytes() == torn


def test_recover_sets_a_journal_without_rows_aside(tmp_path, caplog):
    (tmp_path / "session_01.journal").write_bytes(b"")
    assert sessions.recover(tmp_path) == []
    assert "no whole row" in caplog.text
    assert [p.name for p in tmp_path.iterdir()] == ["session_01.journal.torn"]


def test_recover_ends_a_seal_that_was_killed_and_overwrites_nothing(tmp_path):
    session = make_session()
    path, _ = write_journal(tmp_path, session)
    sealed = sessions.write_session(tmp_path / "session_01.parquet", session)
    before, journal = sealed.read_bytes(), path.read_bytes()
    assert sessions.recover(tmp_path) == [sealed]
    assert not path.exists() and sealed.read_bytes() == before
    path.write_bytes(journal)
    sealed.unlink()
    sessions.write_session(sealed, make_session(seed=1))
    before = sealed.read_bytes()
    with pytest.raises(SerpentError, match="other rows"):
        sessions.recover(tmp_path)
    assert path.read_bytes() == journal and sealed.read_bytes() == before


def test_a_full_disk_leaves_the_journal_at_its_last_row(tmp_path):
    rows = rows_of(make_session())
    with sessions.Journal(tmp_path / "session_01.journal", METADATA) as journal:
        with pytest.raises(OSError) as refused, full_disk(20_000):
            for row in rows:
                journal.append(row)
        assert refused.value.filename == str(journal.path)
        logged = journal.rows
        journal.append(rows[logged])
        back = sessions.read_session(journal.seal())
    assert 0 < logged < 59
    assert_same(back, make_session()[: logged + 1])
