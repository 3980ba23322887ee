"""Test that logs are refused of which one repeats another, however the copy was changed."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from learning_sessions import make_session
from measured_logs import pendulum, write_log
from paths import DATA
from trainings import write, write_five
from typed import typed

from experiments.close_the_loop import __main__ as close_the_loop
from experiments.measured import split as measured_split
from experiments.sim_to_real import arm as sim_to_real_arm
from experiments.sim_to_real.twins import QUICK
from serpent_twin import sessions
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.tables.log import Log
from serpent_twin.tables.repeated import readings_hash, refuse_repeated
from serpent_twin.training.train import Train, train

LOGS = DATA / "arm_a"


@pytest.fixture
def logs(tmp_path) -> Path:
    folder = tmp_path / "logs"
    folder.mkdir()
    return write_five(folder)


def sealed_again(path: Path, source: Path, **other: object) -> None:
    """Write a copy with other metadata, compression and row groups."""
    table = pq.read_table(source)
    about = json.loads(table.schema.metadata[b"serpent_twin"]) | other
    table = table.replace_schema_metadata({"serpent_twin": json.dumps(about)})
    pq.write_table(table, path, compression="snappy", row_group_size=77)


def in_float32(path: Path, source: Path) -> None:
    table = pq.read_table(source)
    columns = [pa.array(column.to_numpy().astype(np.float32)) for column in table.columns]
    schema = pa.schema(
        [pa.field(name, pa.float32()) for name in table.column_names], table.schema.metadata
    )
    pq.write_table(pa.Table.from_arrays(columns, schema=schema), path)


def changed(session: sessions.Session) -> dict[str, sessions.Session]:
    """A session as another might hand it on."""
    rows = slice(120, 180)
    return {
        "markers put in anew": session.having(marker=session.marker + 0.01),
        "another clock": session.having(time=session.time + 1e3),
        "its middle": session[rows],
        "every third row": replace(session[::3], metadata=session.metadata | {"rate_hz": 4 / 3}),
        "other commands": session.having(joint_target=0 * session.joint_target),
    }


@pytest.mark.parametrize("how", [sealed_again, in_float32])
def test_a_copy_is_known_by_what_it_holds(how, logs, tmp_path):
    how(logs / "session_06.parquet", logs / "session_02.parquet")
    with pytest.raises(SerpentError, match=r"session_02.parquet and .*session_06.parquet hold"):
        train(Train(logs, tmp_path / "out", ("analytical",)))
    assert not (tmp_path / "out").exists()
    one, two = (sessions.read_session(logs / f"session_0{n}.parquet") for n in (2, 6))
    assert readings_hash(one) == readings_hash(two)


@pytest.mark.parametrize("how", changed(make_session(1)))
def test_a_part_or_a_changed_copy_is_known(how):
    session = make_session(1)
    with pytest.raises(SerpentError, match="session_01 and session_01 hold the same readings"):
        refuse_repeated([make_session(2), session, changed(session)[how]])


def test_sessions_of_one_arm_are_not_taken_for_each_other():
    refuse_repeated([make_session(n) for n in range(1, 9)])
    # One pose at which both begin, one in which both end and stand.
    one, two = make_session(1), make_session(2)
    for rows in (slice(0, 1), slice(380, 400)):
        for name in ("motor_position", "motor_load"):
            getattr(two, name)[rows] = getattr(one, name)[rows][:1]
        for session in (one, two):
            session.motor_velocity[rows] = 0.0
    refuse_repeated([one, two])
    logged = sessions.read_folder(LOGS)
    refuse_repeated(logged)
    halves = [logged[0][:1000], logged[0][1000:]]
    refuse_repeated(halves)


@pytest.mark.parametrize(
    "options", [[], ["--test", "session_06"], ["--test", "session_01", "--validate", "session_03"]]
)
def test_train_refuses_them_whatever_was_asked(options, logs, tmp_path):
    (logs / "session_06.parquet").write_bytes((logs / "session_04.parquet").read_bytes())
    words = ["--logs", logs, *options, "--out", tmp_path / "out", "--readout", "analytical"]
    done = typed("serpent_twin.train", *words)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "session_04.parquet" in done.stderr and "session_06.parquet" in done.stderr


def test_no_log_of_the_arm_to_adapt_to_has_trained(logs, tmp_path):
    arm = tmp_path / "arm"
    arm.mkdir()
    for number in (11, 12, 13):
        write(arm, make_session(number, rows=300, give=0.45))
    sealed_again(logs / "session_02.parquet", arm / "session_13.parquet", session=2)
    with pytest.raises(
        SerpentError, match=r"logs/session_02.parquet and .*arm/session_13.parquet hold"
    ):
        train(Train(logs, tmp_path / "out", ("analytical",), adapt=arm))


def test_one_folder_is_not_adapted_to_itself(logs, tmp_path):
    with pytest.raises(SerpentError, match=r"session_01.parquet is given twice"):
        train(Train(logs, tmp_path / "out", ("analytical",), adapt=logs / "." / ".." / "logs"))
    assert not (tmp_path / "out").exists()


@pytest.fixture
def twice(tmp_path) -> Path:
    """Logs of an arm, the last of which repeats a part of the first."""
    folder = tmp_path / "arms" / "arm_x"
    folder.mkdir(parents=True)
    first = make_session(1)
    for session in (first, make_session(2)):
        write(folder, session)
    part = first[:300]
    sessions.write_session(folder / "session_03.parquet", replace(part, path=None))
    return folder


@pytest.mark.parametrize(
    "options", [{}, {"held_out": 2}, {"judge": "session_01.parquet"}, {"sessions": 3}]
)
def test_trace_refuses_them_whatever_was_asked(options, twice, tmp_path):
    with pytest.raises(
        SerpentError, match=r"session_01.parquet and .*session_03.parquet hold|3.*and.*1"
    ):
        trace(Trace((twice,), tmp_path / "out", **options))
    assert not (tmp_path / "out").exists()


def test_experiments_refuse_them(twice, tmp_path):
    said = r"session_01.parquet and .*session_03.parquet hold the same readings \(300 of 300"
    with pytest.raises(SerpentError, match=said):
        close_the_loop.main(close_the_loop.CloseTheLoop(twice.parent, tmp_path / "loop"))
    with pytest.raises(SerpentError, match=said):
        sim_to_real_arm.study_arm(twice, tmp_path / "study", 0, QUICK, lambda what: None)
    assert not (tmp_path / "study").exists()


def test_runs_of_other_machines_are_compared_by_all_that_they_measured(tmp_path):
    rng, time = np.random.default_rng(0), np.arange(200) / 100
    runs = [
        Log(None, {}, {"time": time, "angle": rng.normal(size=200)}, f"run {n}") for n in (1, 2)
    ]
    refuse_repeated(runs)
    late = {name: values[50:] for name, values in runs[0].columns.items()}
    with pytest.raises(SerpentError, match="run 1 and a copy hold the same readings"):
        refuse_repeated([*runs, replace(runs[0], columns=late, label="a copy")])


def test_files_that_judge_elsewhere_are_no_copies_of_what_is_fitted(tmp_path):
    for n, name in enumerate(("kp100_a", "kp100_b", "kp200_a")):
        about, columns = pendulum(100, 0.01, 0.02, 0.1, seed=n)
        write_log(tmp_path / "data" / "xl330" / f"{name}.parquet", about, **columns)
    held_out = tmp_path / "new" / "kp400_a.parquet"
    part = {name: values[100:] for name, values in columns.items()}
    write_log(held_out, about | {"kp": 400}, **part)
    with pytest.raises(SerpentError, match=r"kp200_a.parquet and .*kp400_a.parquet hold the same"):
        measured_split.asked(tmp_path / "data", str(held_out))
