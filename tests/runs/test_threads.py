"""Test how many threads simulations take."""

import os

import pytest

from serpent_twin.runs.processes import threads


@pytest.mark.parametrize(("told", "taken"), [("1", 1), ("3", 3), ("", 0), ("0", 0), ("many", 0)])
def test_the_usual_variable_limits_threads(monkeypatch, told, taken):
    monkeypatch.setenv("OMP_NUM_THREADS", told)
    assert threads() == (taken or os.cpu_count())
