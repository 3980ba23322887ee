"""Test external torques beside pulses that push a simulated arm, and the rate of false alarms."""

import held_models
import mujoco
import numpy as np
import pytest
from example import table
from held_models import EXAMPLE, MJCF, PERIOD
from paths import ROOT

from serpent_twin.errors import SerpentError
from serpent_twin.estimators.external_torque import (
    ExternalTorque,
    external_torques,
    pushes,
    thresholds,
)
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine

PULSES = {"shoulder": (0, 3.0, 4.0), "elbow": (1, 6.0, -2.0)}
"""Degree of freedom, time of the peak [s], and size [N m] of each pulse"""
WIDTH = 0.2  # of pulses at half their height [s]
SUBSTEPS = 10
PER_AMPERE = np.array([50 * 0.05, 30 * 0.04])  # torques of the joints [N m/A]


def simulated(path, seed, pulses=(), rows=2000):
    """Write a log of an arm that a controller moves while pulses push it, which no column says."""
    model = mujoco.MjModel.from_xml_string(MJCF)
    model.opt.timestep, model.opt.integrator = PERIOD / SUBSTEPS, mujoco.mjtIntegrator.mjINT_RK4
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)
    wanted, speed, _ = held_models.motion(seed, rows)
    data.qpos[:], data.qvel[:] = wanted[0], speed[0]
    found = np.empty((rows, 5))
    for n in range(rows):
        mujoco.mj_forward(model, data)
        off = [200.0, 60.0] * (wanted[n] - data.qpos) + [20.0, 5.0] * (speed[n] - data.qvel)
        torque = data.qfrc_bias + off
        read = 1e-4 * np.round(data.qpos / 1e-4)
        current = torque / PER_AMPERE + 0.01 * rng.standard_normal(2)
        found[n] = n * PERIOD, *np.degrees(read), *current
        for _ in range(SUBSTEPS):
            data.qfrc_applied[:] = torque
            for dof, peak, size in pulses:
                data.qfrc_applied[dof] += size * 0.5 ** ((data.time - peak) / (WIDTH / 2)) ** 2
            mujoco.mj_step(model, data)
    return table(path, "t,q1,q2,i1,i2", found)


def test_pulses_are_felt_when_where_and_as_strong_as_they_were(tmp_path):
    rig = open_machine(EXAMPLE.write(tmp_path))
    several = {"free": (0, ()), "other": (1, ()), "pushed": (2, tuple(PULSES.values()))}
    logs = [
        rig.recorded(simulated(tmp_path / f"{name}.csv", *how))[0] for name, how in several.items()
    ]
    case = rig.open(rig.prepared(logs[:1]))
    nominal = ParameterVector.nominal(case.declared)
    free, other, pushed = external_torques(rig, case, nominal, logs, 1 / WIDTH)
    threshold = thresholds([free], alarms_per_minute=0.1)
    assert np.all(threshold < 0.5)
    assert not pushes(other, threshold)
    felt = pushes(pushed, threshold)
    assert [each.joint for each in felt] == list(PULSES)
    for push, (_, peak, size) in zip(felt, PULSES.values(), strict=True):
        assert push.time == pytest.approx(peak, abs=0.02)
        assert push.size == pytest.approx(size, rel=0.05)
        assert push.begin < peak < push.end < push.begin + 3 * WIDTH


def test_gaussian_noise_exceeds_thresholds_as_often_as_they_say():
    time, rng = np.arange(0.0, 3600.0, 0.01), np.random.default_rng(0)
    white = rng.standard_normal((len(time), 2))
    kernel = np.exp(-0.5 * (np.arange(-50, 51) / 10) ** 2)
    noise = np.stack([np.convolve(each, kernel, "same") for each in white.T], axis=1)
    found = ExternalTorque(("a", "b"), time, [1.0, 20.0] * noise)
    several = pushes(found, thresholds([found], alarms_per_minute=10.0))
    for joint in found.joints:
        count = sum(each.joint == joint for each in several)
        assert count == pytest.approx(600, abs=4 * np.sqrt(600))


def test_rows_that_are_simulated_say_no_external_torque():
    rig = open_machine(ROOT / "experiments/measured/dfki_double_pendulum_c/machine.toml")
    with pytest.raises(SerpentError, match=r'states rows = "motion".* State rows = "torque"'):
        external_torques(rig, None, None, [], 5.0)


def test_a_log_that_is_too_short_is_refused(tmp_path):
    rig = open_machine(EXAMPLE.write(tmp_path))
    logs = rig.recorded(simulated(tmp_path / "log.csv", 0, rows=400))
    case = rig.open(rig.prepared(logs))
    with pytest.raises(
        SerpentError, match=r"log has too few rows .* pushes of 10 s\. Give a longer"
    ):
        external_torques(rig, case, ParameterVector.nominal(case.declared), logs, 0.1)
