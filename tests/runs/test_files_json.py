"""JSON files are valid JSON, and read as they were written but for what is not finite."""

import json

import numpy as np

from serpent_twin.runs.files import json_text, write_json


def test_what_is_not_finite_becomes_null(tmp_path):
    value = {
        "a": [1.5, np.nan, -np.inf],
        "b": (np.float64(2), True, None),
        "c": np.array([[np.nan, 1]]),
    }
    write_json(tmp_path / "x.json", value)
    text = (tmp_path / "x.json").read_text()
    assert "NaN" not in text and "Infinity" not in text
    expected = {"a": [1.5, None, None], "b": [2, True, None], "c": [[None, 1]]}
    assert json.loads(text) == expected


def test_finite_values_are_written_as_json_writes_them():
    value = {"b": [0.1, 1e300, -3], "a": "Ä\n", "c": {"d": None}}
    for indent in (None, 1, 2):
        assert json_text(value, indent) == json.dumps(value, indent=indent) + "\n"
