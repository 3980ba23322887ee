"""Test what springs of tendons pull, and their stiffening, against bare MuJoCo."""

import mujoco
import numpy as np
import pytest
from example import Example
from mujoco.batch import Batch

from serpent_twin.effects import KNOWN
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.seen import Seen

MJCF = """<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="drum"><joint name="drum" armature="1"/><geom size="0.1" mass="1"/></body>
    <body name="lever">
      <joint name="lever" axis="0 1 0" stiffness="0.5" damping="0.1"/>
      <geom size="0.1" mass="1"/>
    </body>
  </worldbody>
  <tendon>
    <fixed name="slack" stiffness="3" springlength="-0.1 0.2"><joint joint="lever" coef="0.7"/></fixed>
    <fixed name="bare"><joint joint="lever" coef="1"/></fixed>
  </tendon>
  <actuator><motor name="push" joint="lever"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "model.xml"
rows = "motion"
every = 4
time = { column = "time", unit = "s" }
[[drive]]
actuator = "push"
column = "torque"
unit = "N m"
[[measured]]
joint = "lever"
columns = ["angle"]
unit = "rad"
[[measured]]
tendon = "slack"
columns = ["pull"]
unit = "N m"
zero = 0.1
[[uncertain]]
number = "mass"
of = []
"""


@pytest.fixture
def path(tmp_path):
    """A machine.toml beside its model, and a log."""
    Example(MJCF, TOML).write(tmp_path)
    time = np.arange(0, 2, 0.005)
    columns = {
        "time": time,
        "torque": np.sin(5 * time),
        "angle": 0.6 * np.sin(5 * time),
        "pull": time,
    }
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(tmp_path / "log.csv", table, "%.6f", ",", header=",".join(columns), comments="")
    return tmp_path / "machine.toml"


def pulls(described, model, angles):
    """What is seen of the tendon at angles of the lever, and what MuJoCo's springs give the lever there."""
    batch = Batch(model, len(angles), 1)
    seen = Seen(described, {}, [{"zero of pull": 0.0}])
    seen.bind(batch)
    batch.bind("qpos")[:, 1], springs = angles, batch.bind("qfrc_spring")
    batch.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
    return seen.read(batch)[:, 1], springs[:, 1] + 0.5 * angles


def test_the_pull_of_a_tendon_is_what_its_spring_gives_the_joints(path):
    described = open_machine(path).described
    spec = described.spec.copy()
    spec.tendon("slack").stiffness[1:] = 2.0, 5.0
    angles = np.linspace(-1.0, 1.0, 9)
    pull, given = pulls(described, spec.compile(), angles)
    np.testing.assert_allclose(-0.7 * pull, given, atol=1e-12)
    assert (pull == 0).sum() == 2 and pull[-1] > 0 > pull[0]


def test_a_stretched_tendon_stiffens_by_its_rate_and_no_other_does(path):
    described = open_machine(path).described
    spec = described.spec.copy()
    KNOWN["cable_stiffening"](4.0, at="slack").edit(spec)
    pull, _ = pulls(described, spec.compile(), np.array([0.8]))
    stretch = 0.7 * 0.8 - 0.2
    np.testing.assert_allclose(pull, 3 * stretch * (1 + 4 * stretch))
    assert not np.any(spec.tendon("bare").stiffness)


def test_rows_are_thinned_zeros_are_fitted_and_a_kind_without_names_is_not(path):
    rig = open_machine(path)
    runs = rig.read(path.parent)
    np.testing.assert_allclose(np.diff(runs[0].time), 0.02)
    case = rig.open(runs)
    names = [each.name for each in case.declared]
    assert "zero of pull" in names and not [name for name in names if name.startswith("mass")]
    assert [each.measure.one for each in case.machine.outputs] == ["angle", "torque"]
    rates = case.candidates["cable_stiffening@slack"].ranges["rate"]
    assert rates.unit == "1/rad" and 0 < rates.typical < rates.high


def test_a_tendon_without_a_spring_pulls_nothing(path):
    path.write_text(TOML.replace('tendon = "slack"', 'tendon = "bare"'))
    with pytest.raises(SerpentError, match="tendon 'bare' is in m or rad"):
        open_machine(path)
