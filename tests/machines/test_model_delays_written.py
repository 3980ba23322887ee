"""Test that plain MuJoCo simulates the delays of a written twin.xml as the equations of a late arm say."""

import moving_models
import mujoco
import numpy as np
import pytest

from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine

COMMANDS, READING = 0.0313, 0.0217  # [s], no multiples of the time step
NOISE = 5e-4  # [rad]
SENSORS = '<sensor><jointpos joint="elbow"/><jointvel joint="elbow"/></sensor></mujoco>'


def written(folder, log, lacks, sensors=""):
    """The machine's case, the twin with some effects, and its twin.xml: note and model."""
    path = moving_models.machine(folder)
    model = path.with_name("arm.xml")
    fine = model.read_text().replace('timestep="0.004"', 'timestep="0.0005"')
    model.write_text(fine.replace("</mujoco>", sensors or "</mujoco>"))
    rig = open_machine(path)
    recordings = rig.read(log)
    case = rig.open(recordings)
    twin = ParameterVector.nominal(case.declared, {k: np.array([v]) for k, v in lacks.items()})
    case.write(twin, folder / "twin.json", {})
    text = (folder / "twin.xml").read_text()
    return case, recordings, twin, text.splitlines()[0], mujoco.MjModel.from_xml_string(text)


def simulated(model, goals, start):
    """Angles in each row, and the sensors' readings, of what held its first goals before it begins."""
    data, steps = mujoco.MjData(model), round(1 / moving_models.RATE / model.opt.timestep)
    data.qpos[:] = start
    for n in range(model.nu):
        if model.actuator_delay[n]:
            mujoco.mj_initCtrlHistory(
                model, data, n, None, np.full(model.actuator_history[n, 0], goals[0, n])
            )
    angles, read = [], []
    for goal in goals:
        data.ctrl[:] = goal
        mujoco.mj_forward(model, data)
        angles.append(data.qpos.copy())
        for _ in range(steps):
            mujoco.mj_step(model, data)
            read.append(data.sensordata.copy())
    return np.array(angles), np.array(read)


def test_a_late_arm_is_what_plain_mujoco_makes_of_its_twin(tmp_path):
    """Against the arm's equations, which scipy integrates, and against the twin that the trace simulates."""
    log = moving_models.log(tmp_path / "log.csv", 3, late=COMMANDS)
    case, recordings, twin, note, model = written(
        tmp_path / "arm", log, {"command_delay": COMMANDS}
    )
    columns = np.genfromtxt(log, delimiter=",", names=True)
    goals = np.stack([columns["goal_1"], columns["goal_2"]], axis=1)
    truth = np.stack([columns["angle_1"], columns["angle_2"]], axis=1)
    angles, _ = simulated(model, goals, truth[0])
    assert np.std(angles - truth) == pytest.approx(NOISE, rel=0.3)
    model.actuator_delay[:] = 0.0
    assert np.std(simulated(model, goals, truth[0])[0] - truth) > 10 * NOISE
    assert "all effects are here" in note
    pieces = case.pieces(recordings)
    ours = case.machine.respond([twin], pieces)[0]
    at = np.searchsorted(columns["t"], pieces.time[0] - 1e-6)
    assert np.abs(ours[0] - angles[at]).max() < 5 * NOISE


def test_a_late_reading_is_that_of_the_models_sensor(tmp_path):
    log = moving_models.log(tmp_path / "log.csv", 3)
    late = {"sensor_delay@elbow": READING}
    *_, note, model = written(tmp_path / "arm", log, late, SENSORS)
    assert "all effects are here" in note and (model.sensor_delay > 0).tolist() == [True, False]
    goals = np.zeros((50, 2))
    _, read = simulated(model, goals, [0.3, -0.3])
    model.sensor_delay[:] = 0.0
    _, now = simulated(model, goals, [0.3, -0.3])
    time = model.opt.timestep * np.arange(len(now))
    then = np.interp(time - READING, time, now[:, 0])
    known = time > 0.1
    np.testing.assert_allclose(read[known, 0], then[known], atol=1e-9)


def test_a_late_reading_of_a_model_without_sensors_is_that_of_a_sensor_that_is_added(tmp_path):
    log = moving_models.log(tmp_path / "log.csv", 3)
    *_, note, model = written(tmp_path / "arm", log, {"sensor_delay@elbow": READING})
    assert "all effects are here" in note and model.sensor("late elbow").id == 0
    _, read = simulated(model, np.zeros((50, 2)), [0.3, -0.3])
    data, angles = mujoco.MjData(model), []
    data.qpos[:] = [0.3, -0.3]
    for _ in read:
        angles.append(data.qpos[1])
        mujoco.mj_step(model, data)
    time = model.opt.timestep * np.arange(len(read))
    known = time > 0.1
    then = np.interp(time - READING, time, angles)
    np.testing.assert_allclose(read[known, 0], then[known], atol=1e-9)


def test_what_only_twin_json_has_is_named(tmp_path):
    log = moving_models.log(tmp_path / "log.csv", 3)
    lacks = {"sensor_delay@elbow": READING, "gear_backlash@at_elbow": 0.01, "command_delay": 0.01}
    *_, note, model = written(tmp_path / "arm", log, lacks)
    assert (
        note == "<!-- only twin.json has gear_backlash@at_elbow; serpent_twin.attach adds it. -->"
    )
    assert (model.actuator_delay == 0.01).all()
