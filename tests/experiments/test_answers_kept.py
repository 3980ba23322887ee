"""Test what counts as another answer, and the figures of the import graph."""

import copy

import numpy as np
import pytest

from benchmarks.frozen import GOLDEN, _read, differences
from benchmarks.frozen_cases import CASES, find
from benchmarks.structure import circles, floors
from serpent_twin.errors import SerpentError

DIAGNOSED = {
    "effects": {"payload": {"mass": [0.04, 0.001], "strand": [-1.0, 0.0]}},
    "stand_ins": {},
    "unexplained": False,
    "moved": [],
    "verdicts": {"payload": "accepted", "base_tilt": "rejected"},
    "composed": ["force@link9 periodic time"],
    "errors": {"error_mm": {"nominal": 18.0, "calibrated": 1.5, "corrected": 0.44}},
}
LOGGED = {"columns": {"marker1_x": [0.1, 0.02, 0.12]}}


def changed(answer, *path, to):
    """The answer with one entry changed."""
    after = copy.deepcopy(answer)
    inner = after
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = to
    return differences(answer, after)


def test_the_same_answer_and_small_shifts_are_no_difference():
    mass, error = ("effects", "payload", "mass"), ("errors", "error_mm", "corrected")
    assert changed(DIAGNOSED, "composed", to=[]) == []
    assert changed(DIAGNOSED, *mass, to=[0.0401, 0.002]) == []
    assert changed(DIAGNOSED, *error, to=0.445) == []
    assert changed(LOGGED, "columns", "marker1_x", to=[0.1 + 1e-9, 0.02, 0.12]) == []


@pytest.mark.parametrize(
    ("path", "to", "said"),
    [
        (("effects", "payload", "mass"), [0.0403, 0.001], "mass of payload (± 0.001): 0.0403, was"),
        (("effects", "payload", "strand"), [0.0, 0.0], "strand of payload (± 0): 0.0, was -1.0"),
        (("effects",), {}, "effects: none, was payload"),
        (("stand_ins",), {"gravity": {}}, "stand_ins: gravity, was none"),
        (("verdicts", "base_tilt"), "accepted", "base_tilt: accepted, was rejected"),
        (("unexplained",), True, "unexplained: True, was False"),
        (("errors", "error_mm", "corrected"), 0.45, "corrected error_mm: 0.45, was 0.44"),
        (("errors", "error_mm", "nominal"), None, "nominal error_mm: None, was 18.0"),
    ],
)
def test_a_difference_is_named(path, to, said):
    assert [each.startswith(said) for each in changed(DIAGNOSED, *path, to=to)] == [True]


def test_a_session_log_that_differs_is_a_difference():
    assert changed(LOGGED, "columns", "marker1_x", to=[0.1, 0.02, 0.1201])
    assert changed(LOGGED, "columns", to={}) == ["column marker1_x: None, was there"]


def test_every_answer_kept_is_of_a_case():
    names = [case.name for case in CASES]
    assert len(names) == len(set(names))
    assert set(_read(GOLDEN)) <= set(names)
    with pytest.raises(SerpentError, match="no such cases: arm_z"):
        find(["arm_z"])


def test_circles_and_floors_of_a_graph():
    imports = np.zeros((5, 5), bool)
    imports[0, 1] = imports[1, 2] = imports[2, 1] = imports[2, 3] = True  # 0 → (1 ↔ 2) → 3, and 4
    assert circles(list("abcde"), imports) == [["b", "c"]]
    assert floors(imports) == 3
