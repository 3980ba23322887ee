"""Test that tables are read as spreadsheets of several countries write them."""

import numpy as np
import pytest

from serpent_twin.errors import SerpentError
from serpent_twin.stored import read_columns

WRITTEN = {
    "commas": "t,angle\n0,0.5\n1,-1.25\n",
    "spaces": "t, angle\n0, 0.5\n1, -1.25\n",
    "tabs": "t\tangle\n0\t0.5\n1\t-1.25\n",
    "semicolons": "t;angle\n0;0.5\n1;-1.25\n",
    "decimal commas": "t;angle\n0;0,5\n1;-1,25\n",
    "byte order mark": "\ufefft,angle\n0,0.5\n1,-1.25\n",
}


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN)
def test_a_table_is_read_however_its_columns_are_separated(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    found = read_columns(path)
    assert list(found) == ["t", "angle"]
    np.testing.assert_array_equal(found["angle"], [0.5, -1.25])


def test_a_comment_before_the_names_of_the_columns_is_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("# my log\n" + WRITTEN["commas"])
    with pytest.raises(SerpentError, match="Its first line must name the columns"):
        read_columns(path)
