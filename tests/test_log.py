"""Does a session log survive what happens to files, and is damage named?"""

import json
import re
import resource
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from serpent_twin import log
from serpent_twin.errors import SerpentError

LOGS = Path(__file__).resolve().parents[1] / "data" / "arm_a"
METADATA = {"backend": "sim", "arm": "nominal", "session": 1, "rate_hz": 4.0, "seed": 7}
TURN = 2 * np.pi


def make_session(rows: int = 60, seed: int = 0, **metadata: object) -> log.Session:
    """A smooth session with noise in every column; marker 3 is lost in rows 5 … 7."""
    rng = np.random.default_rng(seed)
    clock = np.arange(rows) / 4
    marker = rng.uniform(-0.5, 0.5, (rows, 9, 3))
    marker[5:8, 2] = np.nan
    position = 2 * np.sin(0.3 * clock[:, None] + np.arange(10)) + rng.normal(0, 1e-3, (rows, 10))
    return log.Session(
        path=None,
        metadata={"schema_version": 1} | METADATA | metadata,
        time=clock,
        motor_position=position,
        motor_velocity=0.6 * np.cos(0.3 * clock[:, None] + np.arange(10)),
        motor_load=rng.uniform(-0.2, 0.2, (rows, 10)),
        motor_velocity_command=rng.normal(0, 0.5, (rows, 10)),
        joint_target=rng.uniform(0, 0.3, (rows, 9)),
        marker=marker,
    )


def rows_of(session: log.Session) -> list[dict]:
    return [{name: getattr(session, name)[t] for name in log.FIELDS} for t in range(len(session))]


def assert_same(a: log.Session, b: log.Session) -> None:
    mine, other = log.columns_of(a), log.columns_of(b)
    assert mine.keys() == other.keys()
    for name in mine:
        np.testing.assert_array_equal(mine[name], other[name])


def write_journal(folder: Path, session: log.Session) -> tuple[Path, list[int]]:
    """An unsealed journal of a session, and its size after the header and after each row."""
    with log.Journal(folder / "session_01.journal", METADATA) as journal:
        sizes = [journal.path.stat().st_size]
        for row in rows_of(session):
            journal.append(row)
            sizes.append(journal.path.stat().st_size)
    return journal.path, sizes


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
    return log.write_session(tmp_path / "session_01.parquet", make_session())


def test_a_written_session_is_read_back_exactly(tmp_path):
    session = make_session()
    session = replace(session, extra={"voltage": np.linspace(11, 12, len(session))})
    path = log.write_session(tmp_path / "session_04.parquet", session)
    back = log.read_session(path)
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
    assert tuple(pq.read_schema(path).names) == log.COLUMNS
    session, table = log.read_session(path), pq.read_table(path)
    np.testing.assert_array_equal(session.marker[:, 6, 1], table["marker7_y"].to_numpy())
    np.testing.assert_array_equal(session.motor_load[:, 9], table["motor10_load"].to_numpy())
    assert not [f for s in log.read_folder(LOGS) for f in log.examine(s) if f.level != "note"]


def test_rows_of_a_session_are_views_of_it():
    session = make_session()
    part = session[10:20]
    assert len(part) == 10
    assert part.time[0] == session.time[10]
    assert part.marker.base is not None and np.shares_memory(part.marker, session.marker)


def test_a_sealed_journal_holds_what_was_appended(tmp_path):
    session = make_session()
    with log.Journal(tmp_path / "session_01.parquet", METADATA) as journal:
        for row in rows_of(session):
            journal.append(row)
        sealed = journal.seal()
    back = log.read_session(sealed)
    assert_same(session, back)
    assert back.metadata == session.metadata | {"complete": True, "rows": 60}
    assert [p.name for p in tmp_path.iterdir()] == ["session_01.parquet"]


def test_a_journal_keeps_further_columns(tmp_path):
    with log.Journal(tmp_path / "session_01.journal", METADATA, extra=("voltage",)) as journal:
        for k, row in enumerate(rows_of(make_session())):
            journal.append(row | {"voltage": 12.0 - k / 100})
        back = log.read_session(journal.seal())
    np.testing.assert_array_equal(back.extra["voltage"], 12.0 - np.arange(60) / 100)


def test_a_journal_is_an_arrow_stream_that_any_reader_opens(tmp_path):
    session = make_session()
    path, _ = write_journal(tmp_path, session)
    table = pa.ipc.open_stream(path.read_bytes()).read_all()
    rows = table["row"].combine_chunks().flatten().to_numpy().reshape(60, -1)
    np.testing.assert_array_equal(rows, np.stack(list(log.columns_of(session).values()), axis=1))


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
    with log.Journal(tmp_path / "session_01.journal", METADATA) as journal:
        journal.append(first)
        with pytest.raises(SerpentError, match=says):
            journal.append(change(second))
        journal.append(second)
        assert len(log.read_session(journal.seal())) == 2


def test_400_truncations_give_exactly_the_whole_rows(tmp_path):
    session = make_session()
    path, sizes = write_journal(tmp_path, session)
    data = path.read_bytes()
    rng = np.random.default_rng(1)
    for length in rng.integers(0, len(data) + 1, 400):
        path.write_bytes(data[:length])
        whole = sum(size <= length for size in sizes[1:])
        content = log.read_journal(path)
        assert len(content.rows) == whole
        assert content.bytes_dropped == length - (sizes[whole] if length >= sizes[0] else 0)
        assert whole == 0 or (content.rows[:, 0] == session.time[:whole]).all()


def test_400_changed_bytes_never_pass_for_a_row(tmp_path):
    session = make_session(40)
    path, sizes = write_journal(tmp_path, session)
    data = path.read_bytes()
    expected = np.stack(list(log.columns_of(session).values()), axis=1)
    rng = np.random.default_rng(2)
    for at in rng.integers(0, len(data), 400):
        changed = bytearray(data)
        changed[at] ^= int(rng.integers(1, 256))
        path.write_bytes(changed)
        rows = log.read_journal(path).rows
        hit = max(0, int(np.searchsorted(sizes, at, side="right")) - 1)
        if at >= sizes[0]:
            assert len(rows) >= hit, "a row before the damage is missing"
            values = data.index(expected[hit].tobytes(), sizes[hit])
            if values <= at < values + expected[hit].nbytes:
                assert len(rows) == hit, "a changed row came back"
        np.testing.assert_array_equal(rows, expected[: len(rows)].reshape(rows.shape))


@pytest.mark.parametrize("order", [[0, 2, 3], [0, 1, 1, 2], [0, 2, 1], [1, 2]])
def test_rows_out_of_order_end_the_readable_part(tmp_path, order):
    path, sizes = write_journal(tmp_path, make_session(4))
    data = path.read_bytes()
    frames = [data[a:b] for a, b in pairwise(sizes)]
    path.write_bytes(data[: sizes[0]] + b"".join(frames[k] for k in order))
    good = next((n for n, k in enumerate(order) if n != k), len(order))
    assert len(log.read_journal(path).rows) == good


_RECORDER = """
import sys, json, numpy as np
from serpent_twin import log
from tests.test_log import make_session, rows_of, METADATA
with log.Journal(sys.argv[1] + "/session_01.journal", METADATA) as journal:
    for row in rows_of(make_session(100000)):
        journal.append(row)
        print(journal.rows, flush=True)
"""


def test_kill_9_loses_no_row(tmp_path):
    command = [sys.executable, "-c", _RECORDER, str(tmp_path)]
    root = Path(__file__).resolve().parents[1]
    with subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, text=True) as recorder:
        assert recorder.stdout is not None
        for _ in range(137):
            logged = int(recorder.stdout.readline())
        with pytest.raises(SerpentError, match="recorded right now"):
            log.recover(tmp_path)
        recorder.send_signal(signal.SIGKILL)
        logged = max([logged, *(int(line) for line in recorder.stdout.read().split("\n")[:-1])])
    (sealed,) = log.recover(tmp_path)
    session = log.read_session(sealed)
    assert logged <= len(session) <= logged + 1
    assert session.metadata["recovered"] and not session.metadata["complete"]
    assert_same(session, make_session(100000)[: len(session)])


def test_recover_keeps_a_torn_journal(tmp_path):
    path, sizes = write_journal(tmp_path, make_session())
    torn = path.read_bytes()[: sizes[30] + 11]
    path.write_bytes(torn)
    (tmp_path / "session_01.journal.torn").write_bytes(b"an older one")
    (sealed,) = log.recover(path)
    assert len(log.read_session(sealed)) == 30
    assert log.read_session(sealed).metadata["bytes_dropped"] == 11
    assert not path.exists()
    assert (tmp_path / "session_01.journal.torn").read_bytes() == b"an older one"
    assert (tmp_path / "session_01.journal.torn2").read_bytes() == torn


def test_recover_sets_a_journal_without_rows_aside(tmp_path, caplog):
    (tmp_path / "session_01.journal").write_bytes(b"")
    assert log.recover(tmp_path) == []
    assert "no whole row" in caplog.text
    assert [p.name for p in tmp_path.iterdir()] == ["session_01.journal.torn"]


def test_recover_ends_a_seal_that_was_killed_and_overwrites_nothing(tmp_path):
    session = make_session()
    path, _ = write_journal(tmp_path, session)
    sealed = log.write_session(tmp_path / "session_01.parquet", session)
    before, journal = sealed.read_bytes(), path.read_bytes()
    assert log.recover(tmp_path) == [sealed]
    assert not path.exists() and sealed.read_bytes() == before
    path.write_bytes(journal)
    sealed.unlink()
    log.write_session(sealed, make_session(seed=1))
    before = sealed.read_bytes()
    with pytest.raises(SerpentError, match="other rows"):
        log.recover(tmp_path)
    assert path.read_bytes() == journal and sealed.read_bytes() == before


def test_nothing_is_overwritten(sealed):
    before = sealed.read_bytes()
    with pytest.raises(SerpentError, match="exists already"):
        log.write_session(sealed, make_session(seed=1))
    with pytest.raises(SerpentError, match="exists already"):
        log.Journal(sealed, METADATA)
    assert sealed.read_bytes() == before


@contextmanager
def full_disk(size):
    """No file of this process grows beyond a size meanwhile, as on a full disk; the log that the
    tests' own output goes to must not be caught by it.
    """
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_leaves_no_half_file(sealed):
    before = sealed.read_bytes()
    other = sealed.with_name("session_02.parquet")
    with pytest.raises(OSError) as refused, full_disk(4096):
        log.write_session(other, make_session(seed=1))
    assert refused.value.filename == str(other)
    assert [p.name for p in sealed.parent.iterdir()] == [sealed.name]
    assert sealed.read_bytes() == before


def test_a_full_disk_leaves_the_journal_at_its_last_row(tmp_path):
    rows = rows_of(make_session())
    with log.Journal(tmp_path / "session_01.journal", METADATA) as journal:
        with pytest.raises(OSError) as refused, full_disk(20_000):
            for row in rows:
                journal.append(row)
        assert refused.value.filename == str(journal.path)
        logged = journal.rows
        journal.append(rows[logged])
        back = log.read_session(journal.seal())
    assert 0 < logged < 59
    assert_same(back, make_session()[: logged + 1])


CLOCK = make_session().time
REFUSALS = {
    "no column": (lambda t: t.drop_columns(["marker3_x", "joint9_target"]), "marker3_x"),
    "other type": (lambda t: with_column("motor4_load", np.arange(60))(t), "motor4_load.*int64"),
    "no rows": (lambda t: t.slice(0, 0), "no rows"),
    "time back": (lambda t: with_column("time", np.r_[CLOCK[:30], CLOCK[:30]])(t), "at row 30"),
    "time nan": (lambda t: with_column("time", np.r_[np.nan, CLOCK[1:]])(t), "time"),
    "other rate": (with_metadata(rate_hz=5.0), "claims rate_hz 5.*4 Hz"),
    "no rate": (with_metadata(rate_hz=None), "rate_hz is None"),
    "newer": (with_metadata(schema_version=2), "schema_version 2"),
    "no metadata": (lambda t: t.replace_schema_metadata(None), "no metadata"),
    "no object": (lambda t: t.replace_schema_metadata({"serpent_twin": "[1]"}), "JSON object"),
    "no JSON": (lambda t: t.replace_schema_metadata({"serpent_twin": "{"}), "not JSON"),
    "no arm": (lambda t: t.replace_schema_metadata({"serpent_twin": "{}"}), "lack.*arm"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_read_refuses_and_says_why_and_where(sealed, case):
    change, says = REFUSALS[case]
    edit(sealed, change)
    with pytest.raises(SerpentError, match=says) as refused:
        log.read_session(sealed)
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
        log.read_session(sealed)
    assert str(sealed) in str(refused.value)


def test_a_folder_is_read_in_the_order_of_its_numbers(tmp_path):
    for number in (10, 2, 1, 100):
        session = make_session(seed=number, session=number)
        log.write_session(tmp_path / f"session_{number:02d}.parquet", session)
    (tmp_path / "notes.txt").write_text("not a session")
    assert [s.metadata["session"] for s in log.read_folder(tmp_path)] == [1, 2, 10, 100]


@pytest.mark.parametrize(("key", "value"), [("arm", "other"), ("rate_hz", 4.1)])
def test_a_folder_of_mixed_runs_is_refused(sealed, key, value):
    log.write_session(sealed.with_name("session_02.parquet"), make_session(**{key: value}))
    with pytest.raises(SerpentError, match=f"differ in {key}.*session_01.*session_02"):
        log.read_folder(sealed.parent)


def test_an_empty_or_absent_folder_is_refused_and_a_journal_mentioned(tmp_path, caplog):
    with pytest.raises(SerpentError, match="no folder"):
        log.read_folder(tmp_path / "absent")
    with pytest.raises(SerpentError, match="no session_NN"):
        log.read_folder(tmp_path)
    write_journal(tmp_path, make_session())
    with pytest.raises(SerpentError, match="log recover"):
        log.read_folder(tmp_path)
    log.write_session(tmp_path / "session_02.parquet", make_session())
    log.read_folder(tmp_path)
    assert "session_01.journal" in caplog.text


def put(rows, columns, value):
    """A change of an array: `value`, or a function of what was there, put at rows and columns."""

    def change(x: np.ndarray) -> None:
        x[rows, columns] = value(x[rows, columns]) if callable(value) else value

    return change


def against_the_motion(position: np.ndarray) -> None:
    position[20:, 2] += position[19, 2] - position[20, 2] - 1.2 + TURN


def reboot(position: np.ndarray) -> None:
    position += 3 * TURN
    position[40:, 0] %= TURN


def late(clock: np.ndarray) -> None:
    clock[12:] += 0.4


ALL = slice(None)
DAMAGES = {  # the array, what is done to it, the level and words of the finding that comes first
    "a turn lost": (
        *("motor_position", put(slice(33, None), 6, lambda x: x - TURN)),
        *("error", r"motor7_.*-[01]\.\d\d turns.* row 33"),
    ),
    "a turn gained against the motion": (
        *("motor_position", against_the_motion),
        *("error", r"motor3_.*\+0\.81 turns.* row 20"),
    ),
    "a reboot": ("motor_position", reboot, "error", r"motor1_.*-\d\.\d\d turns.* row 40"),
    "no number": ("motor_load", put(3, 4, np.inf), "error", r"motor5_load.* row 3\."),
    "no target": ("joint_target", put(4, 4, np.nan), "error", r"targets.* row 4\."),
    "millimetres": ("marker", put(ALL, ALL, lambda x: 1000 * x), "error", "Marker 1 .*not metres"),
    "no marker ever": ("marker", put(ALL, ALL, np.nan), "error", "No marker"),
    "no marker for a while": ("marker", put(slice(20, 30), ALL, np.nan), "warning", "All.* 20–29"),
    "one marker lost": ("marker", put(slice(20, 30), 5, np.nan), "warning", "6 .* 10 .* row 20"),
    "a motor stuck": (
        *("motor_position", put(slice(30, 50), 8, 1.5)),
        *("warning", "Motor 9 stands still in rows 30–49"),
    ),
    "overload": ("motor_load", put(7, 3, -1.3), "warning", r"motor4_load.*±1\.3 in row 7"),
    "a missed deadline": ("time", late, "warning", r"1 of 59 .* row 12; .* 2\.6 periods"),
}


def damaged(name: str) -> log.Session:
    """A session that is sound but for one damage."""
    session = make_session()
    array, change, _, _ = DAMAGES[name]
    change(changed := getattr(session, array).copy())
    return replace(session, **{array: changed})


@pytest.mark.parametrize("name", DAMAGES)
def test_check_names_injected_damage(name):
    assert [f.level for f in log.examine(make_session())] == ["note"]
    session, (_, _, level, says) = damaged(name), DAMAGES[name]
    found, *others = log.examine(session)
    assert found.level == level
    assert re.search(says, found.text), found.text
    if level == "error":
        with pytest.raises(SerpentError, match=says):
            log.refuse_damaged([make_session(), session])
    else:
        assert [f.level for f in others] == ["note"]
        log.refuse_damaged([session])


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    root = Path(__file__).resolve().parents[1]
    line = [sys.executable, "-m", "serpent_twin.log", *map(str, arguments)]
    return subprocess.run(line, cwd=root, capture_output=True, text=True, timeout=60)


def test_commands(tmp_path):
    write_journal(tmp_path, make_session())
    recovered = command("recover", tmp_path)
    assert recovered.returncode == 0 and "60 rows recovered" in recovered.stdout
    info = command("info", tmp_path)
    assert info.returncode == 0
    for part in ("nominal", "seed: 7", "14.75", "0.56 %", "recovered"):
        assert part in info.stdout
    assert command("check", tmp_path).returncode == 0
    log.write_session(tmp_path / "session_02.parquet", damaged("a turn lost"))
    (tmp_path / "session_03.parquet").write_bytes(b"PAR1")
    check = command("check", tmp_path)
    assert check.returncode == 1
    assert "jumps" in check.stdout and "session_03.parquet: cannot be used" in check.stdout
    assert "2 of 3 sessions" in check.stderr and "Traceback" not in check.stderr
    absent = command("info", tmp_path / "absent")
    assert absent.returncode == 1 and absent.stderr.startswith("error: There is no")


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_a_turn_lost_in_a_long_gap_is_found_and_a_gap_alone_is_none(turns):
    """A reboot leaves a gap: 2 s in which the motor also went on as commanded, or not at all."""
    session = make_session()
    time = np.where(np.arange(len(session)) < 30, session.time, session.time + 1.75)
    command = np.zeros_like(session.motor_velocity_command)
    command[29] = 0.4
    for moved in (0.0, 0.4 * (time[30] - time[29])):
        position = np.zeros_like(session.motor_position)
        position[30:, 4] = moved + turns * 2 * np.pi
        position[30:, :4] = position[30:, 5:9] = moved
        changed = replace(
            session, time=time, motor_position=position, motor_velocity_command=command
        )
        found = [f.text for f in log.examine(changed) if "turns" in f.text and f.level == "error"]
        assert bool(found) == bool(turns)
        assert all("motor5_position" in text and "row 30" in text for text in found)
