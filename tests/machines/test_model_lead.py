"""Test segments of a machine that forgets how it was, each after a lead from rest in the keyframe."""

import numpy as np
import pytest
from example import Example, opened, table
from scipy.integrate import solve_ivp

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine

SPRING, DAMPING, RATE, SECONDS, LEAD = 2.0, 0.4, 50.0, 12.0, 2.0  # forgets within 0.2 s
MJCF = f"""<mujoco>
  <option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody><body name="arm">
    <joint name="hinge" axis="0 1 0" damping="{DAMPING}" stiffness="{SPRING}" armature="1e-4"/>
    <inertial pos="0 0 0" mass="0.01" diaginertia="1e-6 1e-6 1e-6"/>
  </body></worldbody>
  <actuator><motor name="motor" joint="hinge" ctrlrange="-2 2"/></actuator>
  <sensor><jointpos name="angle" joint="hinge"/></sensor>
</mujoco>
"""
TOML = f"""schema_version = 1
model = "arm.xml"
rows = "motion"
segment = 100
lead = {LEAD}
time = {{ column = "t", unit = "s" }}
drive = [{{ actuator = "motor", column = "torque", unit = "N m", exact = true }}]
measured = [{{ sensor = "angle", columns = ["seen"], unit = "rad", noise = 0.001 }}]
"""


TIED = (
    MJCF.replace("<worldbody>", '<worldbody><site name="wall" pos="0.1 0 0.3"/>')
    .replace("</body>", '<site name="end" pos="0.2 0 0"/></body>')
    .replace(
        "<actuator>",
        """<tendon><spatial name="string" stiffness="0.5" springlength="0 0.3">
        <site site="wall"/><site site="end"/></spatial></tendon><actuator>""",
    )
)
SLACK = 'uncertain = [{ number = "tendon slack", of = ["string"] }]\n'


def torque(time):
    return np.sin(3 * time) + 0.5 * np.cos(7 * time)


def log(path, seconds=SECONDS, lost=()):
    """A spring in oil, which begins elsewhere than the model, by its equation of first order."""
    time = np.arange(0, seconds, 1 / RATE)

    def held(t):
        return torque(np.floor(t * RATE + 1e-6) / RATE)

    found = solve_ivp(
        lambda t, angle: (held(t) - SPRING * angle) / DAMPING,
        (0, seconds), [0.9], t_eval=time, rtol=1e-8, atol=1e-9, max_step=0.5 / RATE,
    )  # fmt: skip
    rows = np.c_[time, torque(time), found.y[0]]
    return table(path, "t,torque,seen", np.delete(rows, lost, axis=0))


def test_what_follows_the_lead_is_the_motion_whatever_was_before(tmp_path):
    case, pieces, at = opened(Example(MJCF, TOML).write(tmp_path), log(tmp_path / "log.csv"))
    lead = round(LEAD * RATE)
    assert len(pieces) == 6 and np.isnan(pieces.measured[:, :lead]).all()
    np.testing.assert_array_equal(pieces.first[1:], np.cumsum(np.diff(pieces.first)))
    off = pieces.measured - case.machine.respond([at], pieces)[0]
    assert np.sqrt(np.nanmean(off**2)) < 5e-4
    begun = case.machine.respond([at], pieces)[0][0, 0, 0]
    assert begun == 0 and abs(pieces.log[0].columns["seen"][0] - begun) > 0.5


def test_segments_whose_start_is_stated_begin_where_the_machine_is_quiet(tmp_path):
    """Each of the rows after the first few counts once, whatever row a segment begins in."""
    text = TOML.replace(f"lead = {LEAD}", "start = 0.06").replace("sensor =", "joint =")
    path = Example(MJCF, text.replace('"angle"', '"hinge"')).write(tmp_path)
    _, pieces, _ = opened(path, log(tmp_path / "log.csv"))
    counted = np.isfinite(pieces.measured[..., 0])
    first = pieces.first + counted.argmax(axis=1)
    rows = np.concatenate(
        [at + np.arange(n) for at, n in zip(first, counted.sum(axis=1), strict=True)]
    )
    np.testing.assert_array_equal(rows, np.arange(15, round(SECONDS * RATE)))
    rate = np.abs(np.gradient(pieces.log[0].columns["seen"]))
    assert len(pieces) == 6 and len(set(first - pieces.first)) > 1
    for begin, at in zip(pieces.first, first, strict=True):
        assert at - 15 <= begin < at - 7 and rate[begin] == rate[at - 15 : at - 7].min()


def test_segments_begin_on_either_side_of_rows_that_are_missing(tmp_path):
    path = log(tmp_path / "log.csv", lost=np.arange(280, 330))
    _, pieces, _ = opened(Example(MJCF, TOML).write(tmp_path), path)
    assert len(set(pieces.session)) == 2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("lead = 2.0", "lead = 11.99"), "no longer than the lead of 11.99 s"),
        (lambda text: text.replace("lead = 2.0", "lead = -1"), "lead"),
        (lambda text: text.replace("lead = 2.0", "lead = 2.0\nstart = 0.1"), "start"),
        (lambda text: text.replace('"motion"', '"poses"'), "lead is of a motion"),
    ],
)  # fmt: skip
def test_a_lead_that_cannot_be_is_refused(tmp_path, change, said):
    path = Example(MJCF, change(TOML)).write(tmp_path)
    with pytest.raises(SerpentError, match=said):
        rig = open_machine(path)
        rig.open(rig.read(log(tmp_path / "log.csv")))


def test_twins_side_by_side_are_what_each_is_alone(tmp_path):
    """Also where effects give some another structure, or a number is one that MuJoCo refuses."""
    path = Example(TIED, TOML.replace("time =", SLACK + "time =")).write(tmp_path)
    case, pieces, at = opened(path, log(tmp_path / "log.csv"))
    names = [each.name for each in case.declared]

    def moved(name, by):
        return at.after(np.where(np.equal(names, name), by, 0.0))

    points = [
        at,
        moved("joint damping of hinge", 0.3),
        at.having("servo_lag", np.array([0.1])),
        moved("tendon slack of string", -1e4),
        at.having("servo_lag", np.array([0.2])),
    ]
    together = case.machine.respond(points, pieces)
    assert np.isnan(together[3]).all()
    for n in (0, 1, 2, 4):
        np.testing.assert_array_equal(together[n], case.machine.respond([points[n]], pieces)[0])
    assert len({each.tobytes() for each in together}) == len(points)


def test_what_remembers_for_longer_than_a_lead_is_no_candidate_and_is_refused(tmp_path):
    case, pieces, at = opened(Example(TIED, TOML).write(tmp_path), log(tmp_path / "log.csv", 60.0))
    lasting = "cable_creep@string"
    assert "cable_stiffening@string" in case.candidates and lasting not in case.candidates
    with pytest.raises(SerpentError, match=r"CableCreep remembers .* lead of 2 s"):
        case.machine.respond([at.having(lasting, np.array([0.1, 10.0, -1.0]))], pieces)
