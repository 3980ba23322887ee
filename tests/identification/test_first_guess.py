"""Test first guesses of a machine whose joints are seen by sites alone, against an independent motion."""

from dataclasses import dataclass
from pathlib import Path

import moving_models
import numpy as np
import pytest
from example import opened, table
from linear_case import LinearCase, case, every
from posed_models import places

from serpent_twin.identification.first_guess import _guess, guessed
from serpent_twin.machines.model import open_machine

SITE = """
[[measured]]
site = "{}"
columns = {}
unit = "m"
cameras = false
noise = 0.0003
"""
SEEN = SITE.format("elbow", ["ex", "ey", "ez"]) + SITE.format("tip", ["x", "y", "z"])


def seen(folder: Path, seed: int) -> Path:
    """A log of the sites in place of the angles, with noise of 0.3 mm."""
    rows = np.loadtxt(moving_models.log(folder / "angles.csv", seed), delimiter=",", skiprows=1)
    at = np.array([places(angles) for angles in rows[:, 3:5]]).reshape(len(rows), 6)
    at += 3e-4 * np.random.default_rng(seed).standard_normal(at.shape)
    (folder / "angles.csv").unlink()
    log = np.c_[rows[:, :3], at]
    return table(folder / "seen.csv", "t,goal_1,goal_2,ex,ey,ez,x,y,z", log, 7)


def machine(folder: Path, gain: float = 4.0, damping: float = 0.15) -> Path:
    """The machine, its motors of some gain [N m/rad] and its joints of some damping [N m s/rad]."""
    path = moving_models.machine(folder)
    about = path.read_text().partition("[[measured]]")[0]
    path.write_text(about + SEEN)
    model = folder / "arm.xml"
    text = model.read_text().replace('kp="4"', f'kp="{gain}"')
    text = text.replace('damping="0.15"', f'damping="{damping}"')
    model.write_text(
        text.replace('<body name="lower"', '<site name="elbow" pos="0.3 0 0"/><body name="lower"')
    )
    return path


def left(case, pieces, at):
    """What a twin leaves, rms [mm]."""
    off = case.machine.respond([at], pieces)[0] - pieces.measured
    return 1e3 * float(np.sqrt(np.nanmean(off**2)))


def test_a_guess_comes_near_from_far_off(tmp_path):
    """Motors four times as stiff and joints five times as damped as the model has them."""
    log = seen(tmp_path, 1)
    path = machine(tmp_path / "machine", gain=1.0, damping=0.03)
    case, pieces, zeros = opened(path, log)
    said: list[str] = []
    found = guessed(case, open_machine(path).read(log), said.append)
    assert left(case, pieces, zeros) > 30 and left(found, pieces, zeros) < 3
    gain = next(q for q in found.quantities if q.name.startswith("actuator gain"))
    assert gain.start == pytest.approx(4.0, rel=0.25) and gain.nominal == pytest.approx(1.0)
    assert said[:3] == [
        "first guess of rigid parts",
        *(f"first guess from row to row, {n}" for n in (1, 2)),
    ]


def test_rows_bend_no_part_that_sites_tell(tmp_path):
    """Motors and joints are far off, which a fit of all would make up for by the marker's place."""
    log = seen(tmp_path, 1)
    path = machine(tmp_path / "machine", gain=1.0, damping=0.03)
    listed = (
        '"actuator gain"\nof = ["*"]',
        '"joint damping"\nof = ["*"]',
        '"site x"\nof = ["tip"]',
    )
    path.write_text(
        path.read_text() + "".join(f"[[uncertain]]\nnumber = {each}\n" for each in listed)
    )
    case, pieces, zeros = opened(path, log)
    logs = open_machine(path).read(log)
    found = guessed(case, logs, lambda _: None)
    place, told = (
        next(each.start for each in some.quantities if each.name == "site x of tip")
        for some in (found, case.starting(case.by_sites(logs)))
    )
    assert left(found, pieces, zeros) < 3 and place == told


def test_what_is_compared_without_a_point_is_the_model_as_it_is(tmp_path):
    log = seen(tmp_path, 2)
    path = machine(tmp_path / "machine", gain=2.0)
    case, pieces, zeros = opened(path, log)
    found = guessed(case, open_machine(path).read(log), lambda _: None)
    was, now = (each.compare(None, pieces).marker_predicted for each in (case, found))
    np.testing.assert_array_equal(now, was)
    assert (found.compare(zeros, pieces).marker_predicted != was).any()


def test_machines_whose_joints_are_read_start_at_their_model(tmp_path):
    case, _, _ = moving_models.opened(tmp_path, 1)
    assert guessed(case, [], lambda _: None) is case


def test_a_fit_begins_where_the_machine_says(tmp_path):
    """A listed start is also the nominal value, so no finding; all else begins as the model has it."""
    path = moving_models.machine(tmp_path / "machine")
    listed = '[[uncertain]]\nnumber = "joint damping"\nof = ["*"]\nprior = 1.0\nbegin = -0.5\n'
    path.write_text(path.read_text() + listed)
    case, _, _ = opened(path, moving_models.log(tmp_path / "log.csv", 1))
    found = guessed(case, [], lambda _: None)
    (damping,) = (q for q in found.quantities if q.name.startswith("joint damping"))
    assert damping.start == damping.nominal == pytest.approx(0.15 * np.exp(-0.5))
    was = [q.start for q in case.quantities if q.name != damping.name]
    assert [q.start for q in found.quantities if q.name != damping.name] == was


def test_a_guess_that_is_stable_in_longer_steps_alone_is_none():
    """A later round would begin there with an error."""

    @dataclass(frozen=True)
    class Brittle(LinearCase):
        def coarse_step(self, points):
            return 0.1  # which changes little of what is left, so that it is used

        def residual(self, points, pieces, timestep=None):
            out = super().residual(points, pieces, timestep)
            brittle = [timestep is None and each.declared[0] > 0.5 for each in points]
            out[brittle] = np.nan
            return out

        def reweighted(self, point, pieces):
            return self

        def pieces(self, sessions):
            return every()

    said: list[str] = []
    arm = Brittle(**case(0.0).__dict__)
    loose = np.ones(2, bool)
    np.testing.assert_array_equal(_guess(arm, [], every(), loose, said.append), np.zeros(2))
    assert len(said) == 1
