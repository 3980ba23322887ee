"""Test measured velocities of joints and sensors of several columns, by logs of MuJoCo in finer steps."""

from functools import cache

import mujoco
import numpy as np
import pytest
from example import Example, assert_named_alone, opened, table

from serpent_twin.effects.sensor_delay import SensorDelay
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.derivatives import derivatives

PERIOD, FINE = 0.01, 0.0005  # [s], of rows and of the truth's steps
G = 9.80665  # [m/s²]
MJCF = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 -9.81" magnetic="2e-5 0 -4e-5" integrator="implicitfast"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" damping="0.1" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0.2 1 0" damping="0.05" armature="0.005"/>
        <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.6"/>
        <site name="imu" pos="0.15 0.01 0.02" euler="0.3 0.2 0.1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="m1" joint="shoulder" kp="20" kv="0.5"/>
    <position name="m2" joint="elbow" kp="10" kv="0.3"/>
  </actuator>
  <sensor>
    <gyro name="gyro" site="imu"/>
    <accelerometer name="accelerometer" site="imu"/>
    <magnetometer name="compass" site="imu"/>
  </sensor>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "motion"
time = { column = "t", unit = "s" }
drive = [
    { actuator = "m1", column = "goal_1", unit = "rad" },
    { actuator = "m2", column = "goal_2", unit = "rad" },
]
measured = [
    { joint = "shoulder", columns = ["q1"], unit = "rad" },
    { joint = "elbow", columns = ["q2"], unit = "rad" },
    MORE
]
"""
VELOCITIES = """{ joint = "shoulder", columns = ["v1"], unit = "rpm" },
    { joint = "elbow", columns = ["v2"], unit = "deg/s" },"""
SENSORS = {
    "gyro": '{ sensor = "gyro", columns = ["gx", "gy", "gz"], unit = "deg/s" },',
    "accelerometer": '{ sensor = "accelerometer", columns = ["ax", "ay", "az"], unit = "g" },',
    "compass": '{ sensor = "compass", columns = ["mx", "my", "mz"], unit = "µT" },',
}
NOISE = np.r_[[1e-3] * 2, [0.02] * 5, [0.1] * 3, [1e-7] * 3]  # [rad], [rad/s], [m/s²], [T]


@cache
def motion(seed: int, friction: float, rows: int):
    """Goals, angles, velocities and readings of sensors [SI], (T, …), read before a row's goals are told, of
    an arm whose elbow has dry friction [N m].
    """
    spec = mujoco.MjSpec.from_string(MJCF)
    spec.option.timestep = FINE
    spec.joint("elbow").frictionloss = friction
    model = spec.compile()
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)
    speed, phase = rng.uniform(1, 6, (4, 2)), rng.uniform(0, 6, (4, 2))
    size = rng.uniform(0.1, 0.25, (4, 2))
    found = []
    for k in range(-100, rows):
        goal = (size * np.sin(speed * k * PERIOD + phase)).sum(axis=0)
        mujoco.mj_forward(model, data)
        found.append(np.r_[goal, data.qpos, data.qvel, data.sensordata])
        data.ctrl[:] = goal
        mujoco.mj_step(model, data, round(PERIOD / FINE))
    return np.array(found[100:])


def log(path, seed, friction=0.0, noise=1.0, rows=1000, late=0):
    """Write a motion in the units of the machine.toml; velocities may be late [rows]."""
    goals, read = np.split(motion(seed, friction, rows), [2], axis=1)
    read = read.copy()
    read[late:, 2:4] = read[: rows - late, 2:4]
    read += noise * NOISE * np.random.default_rng(seed).standard_normal(read.shape)
    read /= np.r_[1, 1, 2 * np.pi / 60, [np.pi / 180] * 4, [G] * 3, [1e-6] * 3]
    head = "t,goal_1,goal_2,q1,q2,v1,v2,gx,gy,gz,ax,ay,az,mx,my,mz"
    return table(path, head, np.c_[PERIOD * np.arange(rows), goals, read])


def example(more=VELOCITIES):
    return Example(MJCF, TOML.replace("MORE", more), log)


@pytest.mark.parametrize("more", [VELOCITIES, *SENSORS.values()])
def test_a_complete_twin_leaves_the_noise_of_each_column(tmp_path, more):
    case, pieces, at = example(more).opened(tmp_path, 0)
    off = pieces.measured - case.machine.respond([at], pieces)[0]
    first = 2 if more is VELOCITIES else 4 + 3 * [*SENSORS.values()].index(more)
    noise = NOISE[[0, 1, *range(first, first + off.shape[-1] - 2)]]
    rms = np.sqrt(np.nanmean(off**2, axis=(0, 1)))
    assert np.all(rms < 1.1 * noise), rms / noise
    estimated = [each.noise for each in case.machine.outputs]
    np.testing.assert_allclose(estimated, noise, rtol=0.15)


def test_velocities_are_channels_beside_the_angles(tmp_path):
    case, pieces, _ = example().opened(tmp_path, 0)
    compared = case.compare(None, pieces)
    assert [each.measure.unit for each in case.machine.outputs] == ["°", "°", "°/s", "°/s"]
    assert compared.marker_names == ("shoulder", "elbow")
    assert compared.load_names == ("shoulder_velocity", "elbow_velocity")
    assert "sensor_delay@elbow_velocity" in case.candidates


def test_a_velocity_is_read_at_the_time_of_its_row(tmp_path):
    """Semi-implicit steps keep it half a step earlier: 0.6 ms, of which a delay would be made."""
    case, pieces, at = example().opened(tmp_path, 0, noise=1e-3)
    machine = case.machine
    shown = machine.respond([at], pieces, timestep=PERIOD / 8)[0]
    off, rate = (
        np.nan_to_num(pieces.measured - shown)[..., 2:],
        np.gradient(shown, PERIOD, axis=1)[..., 2:],
    )
    late = (off * rate).sum() / (rate**2).sum()
    assert abs(late) < 5e-5  # s


@pytest.mark.parametrize("more", [VELOCITIES, *SENSORS.values()])
def test_derivatives_along_a_motion_are_those_of_simulations(tmp_path, more):
    case, pieces, at = example(more).opened(tmp_path, 0, rows=400)
    machine, declared = case.machine, case.declared

    def by(several, size):
        steps = [size * each.step * (each in several) for each in declared]
        return at.after(np.array(steps))

    found = derivatives(
        machine._in_motion([at]), lambda some: machine._moving(by(some, 1.0)), declared, pieces
    )
    assert {*found} == {each.name for each in declared}
    for each in declared:
        there, back = machine.respond([by([each], 0.1), by([each], -0.1)], pieces)
        true, own = ((there - back) / (0.2 * each.step))[..., 2:], found[each.name][..., 2:]
        cosine = (true * own).sum() / np.sqrt((true**2).sum() * (own**2).sum())
        assert cosine > 0.97, each.name
        assert np.sqrt((own**2).sum() / (true**2).sum()) == pytest.approx(1.0, abs=0.1), each.name


def test_a_late_velocity_is_late_alone(tmp_path):
    case, pieces, at = example().opened(tmp_path, 0, late=2)
    delay = SensorDelay(2 * PERIOD, at="elbow_velocity")
    other = at.having("sensor_delay@elbow_velocity", np.array([delay.delay]))
    now, late = case.machine.respond([at, other], pieces)
    np.testing.assert_array_equal(now[..., :3], late[..., :3])
    rms = [np.sqrt(np.nanmean((pieces.measured - each)[..., 3] ** 2)) for each in (now, late)]
    assert rms[1] < 1.1 * NOISE[3] < 0.5 * rms[0]


@pytest.mark.slow
def test_friction_is_named_by_angles_and_velocities(tmp_path):
    found = example().traced(tmp_path, 4, friction=0.05)
    assert_named_alone(found, "hinge_friction@elbow", "coulomb", 0.05)
    assert found["angular_velocity_error_deg_per_s"]["corrected"] < 1.3


def test_the_model_s_own_sensor_of_a_velocity_is_read(tmp_path):
    own = '<jointvel name="tacho" joint="elbow"/></sensor>'
    both = Example(MJCF.replace("</sensor>", own), TOML.replace("MORE", VELOCITIES), log)
    case, *_ = both.opened(tmp_path, 0)
    assert case.machine.places == ("shoulder", "elbow", "shoulder_velocity", "tacho")


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ('{ joint = "wrist", columns = ["v"], unit = "rad/s" }', "'wrist', which the model lacks.*shoulder"),
        ('{ joint = "elbow", columns = ["v2"], unit = "m/s" }', "of m/s; joint 'elbow' is in rad/s"),
        ('{ joint = "elbow", columns = ["v1", "v2"], unit = "rpm" }', "must be 1"),
        ('{ joint = "elbow", columns = ["v1"], unit = "rpm" }, '
         '{ joint = "elbow", columns = ["v2"], unit = "rad/s" }', "measured already"),
        ('{ sensor = "gyro", columns = ["gx", "gy", "gz"], unit = "m/s²" }', "'gyro' is in rad/s"),
        ('{ sensor = "gyro", columns = ["gx", "gy"], unit = "rad/s" }', "must be 3"),
        ('{ sensor = "accelerometer", columns = ["ax", "ay", "az"], unit = "rad/s" }', "is in m/s²"),
    ],
)  # fmt: skip
def test_a_wrong_description_is_refused(tmp_path, more, says):
    with pytest.raises(SerpentError, match=says):
        open_machine(example(more).write(tmp_path))


def test_a_column_that_is_missing_is_named(tmp_path):
    path = example('{ joint = "elbow", columns = ["v3"], unit = "rpm" }').write(tmp_path)
    with pytest.raises(SerpentError, match="'v3'"):
        opened(path, log(tmp_path / "log.csv", 0, rows=50))


@pytest.mark.parametrize(
    "more",
    ['{ joint = "elbow", columns = ["v2"], unit = "rpm" }', SENSORS["gyro"]],
)
def test_a_velocity_is_refused_in_rows_of_poses(tmp_path, more):
    path = example(more).write(tmp_path)
    path.write_text(path.read_text().replace('rows = "motion"', 'rows = "poses"'))
    with pytest.raises(SerpentError, match="which is 0 in rows of poses at rest"):
        open_machine(path)


def test_a_velocity_of_a_prescribed_joint_is_refused(tmp_path):
    path = example(VELOCITIES).write(tmp_path)
    prescribed = '{ joint = "elbow", column = "goal_2", unit = "rad" }'
    text = path.read_text().replace(
        '{ actuator = "m2", column = "goal_2", unit = "rad" }', prescribed
    )
    path.write_text(text.replace('    { joint = "elbow", columns = ["q2"], unit = "rad" },\n', ""))
    with pytest.raises(SerpentError, match="whose motion a drive prescribes"):
        open_machine(path)
