"""Test that the axes of figures say what is drawn: the time of a session, the window of a mean."""

import numpy as np
import pytest

from serpent_twin.identification.figures import place_and_time
from serpent_twin.residual import ANGLE, Comparison, analyse
from serpent_twin.residual.figures import figures

PERIOD, ROWS, SEGMENTS = 0.01, 100, 15  # a session of 15 s in segments of 1 s


def drawn(names=("pan", "tilt"), held=()):
    """The figures of a session, by name; rows of some segments are left out."""
    rng = np.random.default_rng(0)
    time = PERIOD * np.arange(SEGMENTS * ROWS).reshape(SEGMENTS, ROWS)
    keep = [n for n in range(SEGMENTS) if n not in held]
    shape = (SEGMENTS, ROWS, len(names), 1)
    predicted = np.sin(time)[..., None, None] * np.ones(shape)
    one = Comparison(
        session=("run",) * len(keep),
        time=time[keep],
        marker_measured=(predicted + 0.01 * rng.standard_normal(shape))[keep],
        marker_predicted=predicted[keep],
        marker=ANGLE,
        motor_angle=predicted[keep, ..., 0],
        marker_names=tuple(names),
        motor_names=tuple(names),
        motors=(ANGLE,) * len(names),
    )
    found = analyse(one, rng, permutations=9)
    several = [*figures({"calibrated": one}, found), place_and_time({"calibrated": (one, found)})]
    return {each.name: each.drawing.axes[0] for each in several}


def test_the_time_of_a_figure_is_that_of_the_session():
    axes = drawn()
    assert axes["place_and_time"].get_xlim() == pytest.approx((0, 15))
    assert axes["error_over_time"].get_xlim() == pytest.approx((0, 15), abs=0.02)


def test_a_mean_is_taken_over_what_its_label_says():
    """White noise that is averaged over 1.5 s keeps 1/√150 of its deviation; segments are 1 s."""
    axes = drawn()["error_over_time"]
    assert "mean over 1.5 s" in axes.get_ylabel()
    (line,) = (each for each in axes.lines if len(each.get_xdata()) > 2)
    inside = line.get_ydata()[100:-100]
    assert len(line.get_xdata()) == SEGMENTS * ROWS
    assert np.abs(np.diff(inside)).max() < 0.05 * np.mean(inside)


def test_lines_are_broken_where_rows_are_missing():
    axes = drawn(held=(7,))["error_over_time"]
    assert sorted(len(each.get_xdata()) for each in axes.lines) == [700, 700]


def test_only_what_follows_along_a_chain_is_joined():
    joined = {names: drawn(names)["error_by_marker"].lines[0].get_linestyle()
              for names in (("pan", "tilt"), ("angle 1", "angle 2"))}  # fmt: skip
    assert joined == {("pan", "tilt"): "None", ("angle 1", "angle 2"): "-"}
