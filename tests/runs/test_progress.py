"""Test that a long command shows what it does, that steps only grow, and that it lives."""

import re
import time

import numpy as np
import pytest

from serpent_twin.runs import progress as module
from serpent_twin.runs.progress import Progress


@pytest.fixture
def shown(capsys):
    """The lines that were shown so far, one after the other."""

    def read():
        text = capsys.readouterr().err
        return [line.strip() for line in re.split(r"[\r\n]", text) if line.strip()]

    return read


def steps(lines):
    return [int(re.search(r"step (\d+)", line)[1]) for line in lines if "step" in line]


def test_a_long_step_gives_signs_of_life_with_the_simulations_made(shown, monkeypatch):
    monkeypatch.setattr(module, "_IN_FILE", 0.01)
    made = iter(range(1, 10**6))
    with Progress("first guesses", lambda: next(made)) as progress:
        progress.step("a long fit")
        time.sleep(0.3)
    lines = [line for line in shown() if "a long fit" in line]
    counts = [int(re.search(r"([\d,]+) simulation", line)[1].replace(",", "")) for line in lines]
    assert len(lines) > 3 and counts == sorted(set(counts))


def test_steps_only_grow_and_no_share_of_an_unknown_whole_is_shown(shown):
    with Progress("first guesses") as progress:
        for n in range(126):
            progress.step(f"fit {n}")
    lines = shown()
    assert steps(lines) == sorted(steps(lines)) and steps(lines)[-1] == 126
    assert not any("%" in line for line in lines)
    assert "done" in lines[-1]


def test_items_that_are_counted_have_a_time_left_from_those_before(shown, monkeypatch):
    now = iter(np.repeat([100.0, 110.0, 120.0], 2).tolist()[1:])  # the first has no time left
    with Progress("first guesses") as progress:
        monkeypatch.setattr(module.time, "perf_counter", lambda: next(now))
        for n in range(3):
            progress.item("limit", n, 3)
        monkeypatch.undo()
    lines = [line for line in shown() if "limit" in line]
    assert "left" not in lines[0] and "limit, 1 of 3" in lines[0]
    assert "2 of 3, about 00:20 left" in lines[1] and "3 of 3, about 00:10 left" in lines[2]


def test_what_was_stopped_is_named(shown):
    with pytest.raises(ValueError), Progress("first guesses") as progress:
        progress.step("fit last")
        raise ValueError
    assert "stopped: fit last" in shown()[-1]


def test_an_item_that_takes_longer_than_those_before_has_more_left():
    """Two of three are left after 10 s: 20 s; when the second has taken 20 s, the mean is 15 s."""
    assert module._Items(0.0, 10.0, 1, 3).left(10.0) == pytest.approx(20.0)
    assert module._Items(0.0, 10.0, 1, 3).left(30.0) == pytest.approx(10.0)
