"""Test the guess of rigid parts by where sites are, against forward kinematics written out here."""

import numpy as np
import pytest
from example import Example

from serpent_twin.identification.first_guess import guessed
from serpent_twin.machines.model import open_machine

UPPER, LOWER, TIP = 0.31, 0.24, np.array([0.2, 0.003, 0.0])
"""The real lengths [m], of 0.3 and 0.25 in the model, and the place of the tip's marker, there 0.2, 0, 0"""
MJCF = """<mujoco>
  <option gravity="0 0 0" timestep="0.01"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.5"/>
      <geom size="0.03" mass="0.3"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.5"/>
        <geom size="0.03" mass="0.2"/>
        <site name="middle"/>
        <body name="hand" pos="0.25 0 0"><geom size="0.02" mass="0.1"/><site name="wrist"/>
          <site name="tip" pos="0.2 0 0"/></body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="first" joint="shoulder" kp="20"/><position name="second" joint="elbow" kp="20"/>
  </actuator>
</mujoco>
"""
SITE = """[[measured]]
site = "{0}"
columns = ["{0}_x", "{0}_y", "{0}_z"]
unit = "m"
cameras = false
"""
TOML = """schema_version = 1
model = "model.xml"
rows = "motion"
start = 0.1
time = { column = "t", unit = "s" }
[[drive]]
actuator = "first"
column = "goal_1"
unit = "rad"
[[drive]]
actuator = "second"
column = "goal_2"
unit = "rad"
[[uncertain]]
number = "body x"
of = ["lower", "hand"]
[[uncertain]]
number = "site y"
of = ["tip"]
[[uncertain]]
number = "site x"
of = ["tip"]
""" + "".join(map(SITE.format, ("middle", "wrist", "tip")))


def along(angle):
    """A turn about y, (N, 3, 3)."""
    c, s, o = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    return np.moveaxis(np.array([[c, o, s], [o, o + 1, o], [-s, o, c]]), -1, 0)


def places(angle, other):
    """Where the real machine's sites are at the angles of both joints [m], (N, 9)."""
    first, both = along(angle), along(angle + other)
    middle = first @ [UPPER, 0, 0]
    wrist = middle + both @ [LOWER, 0, 0]
    return np.concatenate([middle, wrist, wrist + both @ TIP], axis=1)


def angles(t, n):
    """Angles of both joints [rad], at times of session n [s]."""
    return 0.7 * np.sin(0.9 * t + n), 0.2 + 0.9 * np.sin(1.7 * t + 2 * n)


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    """The machine and two sessions of it, markers with a noise of 0.2 mm."""
    folder, rng = tmp_path_factory.mktemp("arm"), np.random.default_rng(5)
    Example(MJCF, TOML).write(folder)
    (folder / "logs").mkdir()
    names = [f"{site}_{axis}" for site in ("middle", "wrist", "tip") for axis in "xyz"]
    for n in range(2):
        t = 0.05 * np.arange(400)
        angle, other = angles(t, n)
        at = places(angle, other) + 2e-4 * rng.standard_normal((len(t), 9))
        rows = np.c_[t, angle, other, at]
        header = ",".join(["t", "goal_1", "goal_2", *names])
        np.savetxt(
            folder / "logs" / f"run_{n}.csv", rows, delimiter=",", header=header, comments=""
        )
    rig = open_machine(folder / "machine.toml")
    return rig, rig.read(folder / "logs")


def test_lengths_and_markers_are_found_and_what_moves_no_site_stays(sessions):
    rig, logs = sessions
    case = rig.open(logs)
    found = dict(zip([each.name for each in case.declared], case.by_sites(logs), strict=True))
    assert 0.3 * np.exp(found.pop("body x of lower")) == pytest.approx(UPPER, abs=3e-4)
    assert 0.25 * np.exp(found.pop("body x of hand")) == pytest.approx(LOWER, abs=3e-4)
    assert found.pop("site y of tip") == pytest.approx(3.0, abs=0.1)
    assert found.pop("site x of tip") == pytest.approx(0.0, abs=0.3)
    assert found and not any(found.values())


def test_what_sites_tell_of_parts_is_as_sharp_as_the_parts_found_are_right(sessions):
    rig, logs = sessions
    case = rig.open(logs)
    found = case.by_sites(logs)
    told = case.starting(found).knowing_parts(logs).told
    names = [each.name for each in case.declared]
    of = [names.index(name) for name in ("body x of lower", "body x of hand", "site y of tip")]
    true = np.array([np.log(UPPER / 0.3), np.log(LOWER / 0.25), 3.0])
    rigid = np.flatnonzero(np.diag(told))
    error = np.full(len(names), np.inf)
    error[rigid] = np.sqrt(np.diag(np.linalg.inv(told[np.ix_(rigid, rigid)])))
    off = np.abs(found[of] - true) / error[of]
    assert np.isfinite(error[of]).all() and (off < 4).all() and off.max() > 0.05
    others = np.setdiff1d(np.arange(len(names)), rigid)
    assert len(others) and not told[others].any() and not told[:, others].any()


def test_noise_of_sites_is_what_no_pose_explains(sessions):
    """Along each axis in which it moves, however quickly, which from row to row looks like noise."""
    rig, logs = sessions
    rng, spread = np.random.default_rng(5), {"x": 4e-4, "y": 2e-4, "z": 8e-4}
    columns = [(f"{site}_{axis}", axis) for site in ("middle", "wrist", "tip") for axis in "xyz"]
    quick = []
    for log in logs:
        rows = log[::8]
        noise = {name: spread[axis] * rng.standard_normal(len(rows)) for name, axis in columns}
        quick.append(rows.having(**{name: rows.columns[name] + noise[name] for name in noise}))
    case = rig.open(quick)
    known = case.starting(case.by_sites(quick)).knowing_parts(quick)
    before, after = (
        np.reshape([each.noise for each in of.machine.outputs], (3, 3))[:, [0, 2]]
        for of in (case, known)
    )
    true = np.tile(np.hypot([spread["x"], spread["z"]], 2e-4), (3, 1))
    assert (before[:, 0] > 1.5 * true[:, 0]).all()
    assert after == pytest.approx(true, rel=0.15)


def test_segments_begin_where_the_guessed_machine_has_its_sites(sessions):
    """Segments begin in the angles that the machine had; model lengths, a centimetre off, give others."""
    rig, logs = sessions
    case = rig.open(logs)
    off = []
    for each in (case, case.starting(case.by_sites(logs))):
        pieces = each.pieces(logs)
        n = np.array([int(name.removeprefix("run_")) for name in pieces.session])
        told = np.stack([pieces.column[f"angle of {j}"][:, 0] for j in ("shoulder", "elbow")], 1)
        off.append(np.abs(told - np.stack(angles(pieces.time[:, 0], n), axis=1)).mean())
    assert off[0] > 3e-3 and off[1] < 5e-4


def test_a_first_guess_begins_with_the_parts(sessions):
    said = []
    rig, logs = sessions
    found = guessed(rig.open(logs), logs, said.append)
    assert said[0] == "first guess of rigid parts"
    quantity = next(q for q in found.quantities if q.name == "body x of lower")
    assert quantity.start == pytest.approx(UPPER, rel=0.01)
