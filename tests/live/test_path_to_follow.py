"""A path's file is read, or refused with the line that is wrong."""

import numpy as np
import pytest

from serpent_twin.errors import SerpentError
from serpent_twin.live.path import read

GOOD = "time,x,y,z\n2,0.48,0,-0.2\n3,0.48,0.01,-0.2\n5,0.48,0.03,-0.2\n"


def written(tmp_path, text):
    path = tmp_path / "path.csv"
    path.write_text(text)
    return path


def test_between_points_the_way_is_straight_and_time_begins_at_zero(tmp_path):
    path = read(written(tmp_path, GOOD))
    assert path.of_tip
    assert path.duration == 3.0
    np.testing.assert_allclose(path.at(np.array([0.5, 2.0, 9.0]))[:, 1], [0.005, 0.02, 0.03])


def test_a_path_of_joints(tmp_path):
    names = ",".join(f"joint{j}" for j in range(1, 10))
    path = read(written(tmp_path, f"time,{names}\n0{',0.1' * 9}\n1{',0.2' * 9}\n"))
    assert not path.of_tip
    assert path.points.shape == (2, 9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,x,y\n0,1,1\n1,1,1\n", "lacks z"),
        ("time,joint1\n0,1\n1,1\n", "lacks joint2"),
        ("time,x,y,z\n0,1,1,1\n", "has 1 point; a path needs two"),
        ("time,x,y,z\n0,1,1,1\n0,1,1,1\n", "line 3: the time 0 s does not come after 0 s"),
        ("time,x,y,z\n0,1,1,1\n1,1,nan,1\n", "line 3: y is no number"),
        ("time,x,y,z\n0,1,a,1\n1,1,b,1\n", "the column y does not hold numbers"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, said):
    with pytest.raises(SerpentError, match=said):
        read(written(tmp_path, text))
