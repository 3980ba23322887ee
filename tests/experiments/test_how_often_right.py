"""Test that lines of arms add up over studies, and that rates are counted from them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.right_names import chosen, trial_of
from experiments.confusion.arm_line import ArmLine, add, line_of, read
from experiments.confusion.arms import GENERATION
from experiments.confusion.config import Confusion
from experiments.confusion.plan import CLEAN, KNOWN, OUTSIDE, PAIR, Trial
from experiments.confusion.stated_limits import stated_limits, times_limit
from experiments.how_often_right import __main__ as how_often_right
from experiments.how_often_right.rates import LAST, rates
from experiments.result_rows import failed_row
from serpent_twin import __version__
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.track_record import track_record

LINE = ArmLine(
    version=__version__,
    commit="0123456789ab",
    source="bench",
    seed=0,
    sessions=2,
    steps=600,
    generation=GENERATION,
    arm="clean-00-0",
    kind=CLEAN,
    there="none",
    strength=float("nan"),
    unit="",
    called="nothing",
    right=True,
    discovered=False,
    unexplained=False,
    off=float("nan"),
    held=0,
    intervals=0,
    parts_held=0,
    parts=0,
    calibrated_mm=0.5,
    corrected_mm=0.5,
    complete_mm=0.4,
    seconds=120.0,
    worth=1.0,
    times_limit=float("nan"),
    limits="",
)


LIMIT = 0.09  # kg


def heavy(strength, called="payload", number=0, **others):
    known = {"off": 0.1, "held": 1, "intervals": 1} if called == "payload" else {}
    there = {"arm": f"payload-{number:02d}", "kind": KNOWN, "there": "payload", "unit": "kg"}
    there |= {"times_limit": strength / LIMIT, "limits": f"base_tilt 0.01, payload {LIMIT}"}
    right = called == "payload"
    return replace(
        LINE, strength=strength, called=called, right=right, **{**there, **known, **others}
    )


def test_lines_add_up_and_an_arm_traced_again_takes_its_place(tmp_path):
    path = tmp_path / "rows.csv"
    add(path, [LINE, heavy(0.1)])
    later = replace(LINE, commit="ba9876543210", called="payload", right=False)
    add(path, [heavy(0.1, called="nothing"), later])
    found = read(path)
    assert [each.called for each in found] == ["nothing", "nothing", "payload"]
    blank = {"strength": 0, "off": 0, "times_limit": 0}
    assert np.isnan(found[0].strength) and replace(found[2], **blank) == replace(later, **blank)
    with pytest.raises(
        SerpentError, match=r"none.csv does not exist. experiments.confusion --rows"
    ):
        read(tmp_path / "none.csv")
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(SerpentError, match="holds no lines"):
        read(tmp_path / "other.csv")


def test_an_arm_whose_trace_failed_is_a_line_that_says_so():
    trial = Trial("payload-03", KNOWN, (("payload", 0.5),), 3)
    line = line_of(failed_row(trial, "it diverged."), trial, Confusion(Path("out"), "bench"))
    assert (line.called, line.right, line.sessions, line.there) == ("failed", False, 3, "payload")
    found = rates([line, LINE])
    failed = found["rates"]["traces that failed"]
    assert (failed["count"], failed["of"]) == (1, 2)
    assert found["effects"][0]["right"].startswith("0 of 1") and not found["trials"]


def test_rates_count_what_is_right():
    weak = [heavy(0.01 * n, "nothing", n) for n in range(1, 6)]
    strong = [heavy(0.1 * n, number=n) for n in range(1, 9)]
    wrong = heavy(0.05, "gear_backlash", 20)
    named = replace(LINE, called="base_tilt", right=False)
    both = replace(strong[0], kind=PAIR, there="payload + base_tilt", arm="payload+base_tilt-00")
    odd = replace(LINE, kind=OUTSIDE, there="knocked_marker", arm="knocked_marker-00")
    laws = [replace(odd, called="discovered", discovered=good, right=good) for good in (1, 1, 0)]
    found = rates([LINE, named, *weak, *strong, wrong, both, *laws])
    count = {name: (each["count"], each["of"]) for name, each in found["rates"].items()}
    assert count["false alarms"] == (1, 2)
    assert count["a name that is not there"] == (1, 18)
    assert count["true strength in its 95 % interval"] == (9, 9)
    assert count["its law and place discovered"] == (2, 3)
    (effect,) = found["effects"]
    assert effect["stated"] == {"2": LIMIT}
    assert count["named, from twice the detection limit on that its trace stated"] == (7, 7)
    assert 0.5 < float(found["named_from"]) < 2.0
    assert found["names"]["payload"] == {"given": 9, "right": 9}
    assert found["names"]["discovered"] == {"given": 3, "right": 2}
    json.dumps(found, allow_nan=False)


def test_arms_as_built_are_told_besides():
    drawn = replace(LINE, called="base_tilt", right=False, generation=1)
    found = rates([drawn, LINE, LINE])["rates"]["false alarms"]
    assert (found["count"], found["of"]) == (1, 3)
    assert (found["as_built"]["count"], found["as_built"]["of"]) == (0, 2)


def test_arms_traced_last_are_told_besides():
    """The last arms are taken from those as built."""
    early = [replace(LINE, called="payload", right=False)] * 3
    drawn = replace(LINE, generation=1)
    found = rates([*early, *[LINE] * LAST, drawn])
    assert found["last"] == LAST
    alarms = found["rates"]["false alarms"]
    assert (alarms["count"], alarms["of"]) == (3, LAST + 4)
    assert (alarms["last"]["count"], alarms["last"]["of"]) == (0, LAST)
    assert found["rates"]["traces that failed"]["last_said"].startswith(f"0 of {LAST} ")


def test_the_page_and_what_reports_quote_are_of_one_version(tmp_path, monkeypatch, capsys):
    rows, page = tmp_path / "rows.csv", tmp_path / "docs" / "how-often-right.md"
    old = replace(LINE, version="0.0.1", called="payload", right=False, arm="clean-09-1")
    add(rows, [LINE, old, *(heavy(0.1 * n, number=n) for n in range(1, 9))])
    monkeypatch.setattr(how_often_right, "RECORD", tmp_path / "track_record.json")
    config = how_often_right.HowOftenRight(tmp_path / "out", rows, page=page, record=True)
    how_often_right.main(config)
    assert "false alarms: 0 of 1" in capsys.readouterr().out
    text = page.read_text()
    assert "| false alarms | at most 1 % | 0 of 1" in text and "how_often_right.png" in text
    assert (page.parent / "figures" / "taken_for.png").stat().st_size > 5_000
    assert track_record(tmp_path)["payload"] == (8, 8)
    with pytest.raises(SerpentError, match=r"no arms of version 9; it has 0.0.1 and"):
        how_often_right.main(replace(config, version="9"))


def test_the_gate_takes_unlike_faults_and_finds_their_trials():
    many = [replace(LINE, arm=f"clean-00-{n}") for n in range(2)]
    many += [heavy(0.1, number=3), heavy(0.1, number=3, commit="ba9876543210", called="nothing")]
    some = chosen(many, 2)
    assert [each.there for each in some] == ["none", "payload"]
    assert some[1].called == "nothing"
    trial = trial_of(some[1])
    assert (trial.id, trial.sessions, trial.kind) == ("payload-03", 2, KNOWN)


def test_the_gate_takes_as_many_faults_as_its_time_allows():
    many = [replace(LINE, arm=f"clean-00-{n}", seconds=100 + n) for n in range(3)]
    many += [replace(heavy(0.1, number=n), seconds=200 + 10 * n) for n in range(2)]
    many += [replace(heavy(0.1), there="base_tilt", arm="base_tilt-00", seconds=300)]

    def times(count: int, seconds: float) -> list[float]:
        return [each.seconds for each in chosen(many, count, seconds)]

    assert times(3, 601) == [100, 200, 300]
    assert times(3, 500) == [100, 200, 101]
    assert times(3, 400) == times(3, 0) == [100, 101, 102]
    assert times(9, 0) == [100, 101, 102, 200, 210, 300]
    assert chosen([], 3) == []


def test_faults_that_were_worth_finding_are_counted_alone():
    outside = replace(LINE, kind=OUTSIDE, there="soft_stop")
    lines = [
        replace(outside, worth=100.0, discovered=True),
        replace(outside, worth=31.0),
        replace(outside, worth=29.0),
        outside,
    ]
    found = rates(lines)["rates"]
    (name,) = [each for each in found if "worth 30" in each]
    assert (found[name]["count"], found[name]["of"]) == (1, 2)


def test_limits_are_of_the_whole_strength_of_an_effect():
    stated = [
        {"name": "base_tilt", "limit": 0.01},
        {"name": "payload", "limit": 0.02},
        {"name": "gear_backlash", "limit": None},
        {"name": "cable_creep", "limit": float("inf")},
    ]
    limits = stated_limits({"identifiability": {"effects": stated}})
    assert limits == {"base_tilt": pytest.approx(0.01 * np.sqrt(2)), "payload": 0.02}
    tilted = {"name": "base_tilt", "strong": ["about_y", "about_z"]}
    tilted["parameters"] = {"about_y": 0.01, "about_z": -0.01}
    assert times_limit(tilted, limits) == pytest.approx(1.0)
    none = {"name": "cable_creep", "strong": ["fraction"], "parameters": {"fraction": 0.5}}
    assert np.isnan(times_limit(none, limits))
