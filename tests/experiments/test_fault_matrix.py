"""Test that the fault matrix detects a row that is wrong, old, lost, or commanded otherwise."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from experiments.fault_matrix import __main__ as fault_matrix
from experiments.fault_matrix.result_page import LABELS
from experiments.result_page import markdown
from serpent_twin.emulator.verify import check_rows, read_transcript


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A session over the wire and the device's transcript of it, made by the experiment itself."""
    folder = tmp_path_factory.mktemp("matrix")
    # A busy machine takes 25 ms a cycle; a log whose rows are further apart than it claims is refused.
    config = fault_matrix.FaultMatrix(out=folder, cycles=40, rate_hz=10)
    result = fault_matrix.run_fault(config, "drop")
    session = fault_matrix.read_session(folder / "drop" / "run" / "logs" / "session_01.parquet")
    return result, session, read_transcript(folder / "drop" / "run" / "transcript.jsonl")


def counts(session, events):
    return asdict(check_rows(session, events))


def test_a_run_with_a_fault_is_whole_and_true(run):
    result, session, events = run
    assert result["rows"] == 40
    assert result["rows_lost"] == result["rows_wrong"] == result["rows_stale"] == 0
    assert counts(session, events)["wrong"] == 0
    assert 0 < result["stop_s"] < 5
    json.dumps(result)


def test_one_wrong_word_in_one_row_is_noticed(run):
    _, session, events = run
    load = session.motor_load.copy()
    load[7, 3] += 0.001
    assert counts(session.having(motor_load=load), events)["wrong"] == 1


def test_a_lost_turn_is_noticed(run):
    _, session, events = run
    position = session.motor_position.copy()
    position[30:, 3] += 2 * np.pi
    assert counts(session.having(motor_position=position), events)["wrong"] == 10


def test_a_row_of_old_readings_is_noticed(run):
    _, session, events = run
    old = {
        name: getattr(session, name).copy()
        for name in ("motor_position", "motor_velocity", "motor_load")
    }
    tick = session.extra["motor1_tick_ms"].copy()
    for array in (*old.values(), tick):
        array[20] = array[15]
    stale = session.having(**old, motor1_tick_ms=tick)
    assert counts(stale, events)["stale"] == 1


def test_a_command_that_was_never_in_force_is_noticed(run):
    _, session, events = run
    command = session.motor_velocity_command.copy()
    quiet = int(np.flatnonzero(session.extra["recoveries"][1:] == 0)[3])
    command[quiet] += 0.1
    before = counts(session, events)
    after = counts(session.having(motor_velocity_command=command), events)
    assert after["wrong"] == before["wrong"] + 1


def test_the_page_has_a_row_for_each_fault_and_the_times_of_a_cycle(run):
    times = {"median": 6.54, "p99": 7.0, "times_its_bytes": 1.384}
    cycle = dict.fromkeys(("in_process", "over_the_wire", "over_the_wire_at_1_mbd"), times)
    result = run[0] | {"struck": {"drop": 3}, "rows_interrupted": 2, "recoveries": 5}
    origin = {"measured_by": "experiments.fault_matrix", "date": "2026-11-23", "git_commit": "abc"}
    results = {"faults": {"drop": result}, "cycle_ms": cycle} | origin
    page = markdown(results | {"settings": {"cycles": 40, "rate_hz": 50.0}, "versions": {"a": "1"}})
    assert f"| dropped, 0.5 % | 3 | 40 | 0 | 0 | 5 | 2 | {result['stop_s']:.2f} |" in page
    assert "40 cycles" in page and "50 Hz" in page and "1.38 ×" in page
    assert set(LABELS) == set(fault_matrix.FAULTS)
