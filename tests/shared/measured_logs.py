"""Logs of machines whose truth is known, in the form of the measured ones."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from paths import SHARED
from scipy.integrate import solve_ivp

DATA = SHARED / "measured"
WHERE = "the measured logs are not in ../shared/measured beside this checkout"


def write_log(path, metadata, **columns):
    """One run as Parquet with its metadata."""
    table = pa.table({name: np.asarray(values, float) for name, values in columns.items()})
    raw = {b"measured": json.dumps(metadata).encode()}
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table.replace_schema_metadata(raw), path)
    return path


def pendulum(kp, coulomb, viscous, share, saturation=0.0, seconds=4.0, seed=0):
    """A servo swinging 0.49 kg at 0.1 m, integrated by scipy, its friction a steep tanh.

    The motor is the XL330-M288's at 5 V: 0.52 N m stalled, 103 rpm free. The friction's Coulomb part is
    `coulomb` and the share of the mean of the motor's and the load's torques.
    """
    rng = np.random.default_rng(seed)
    per_volt, back_emf, inertia = 0.104, 5 / (103 * np.pi / 30), 0.49 * 0.1**2 + 1.7e-3
    frequency, size = rng.uniform(0.4, 0.9, 3), rng.uniform(0.4, 0.7, 3)
    time = np.arange(0, seconds, 0.005)
    goal = (size[:, None] * np.sin(2 * np.pi * frequency[:, None] * time)).sum(axis=0)
    duty = 4096 / (2 * np.pi) / 256 / 885

    def motion(t, state):
        q, v = state
        held = goal[min(int(t / 0.005 + 1e-9), len(goal) - 1)]
        volts = 7.4 * np.clip(kp * duty * (held - q), -1, 1)
        drive = per_volt * (volts - back_emf * v)
        drive /= 1 + saturation * abs(drive)
        weight = 0.49 * 9.81 * 0.1 * np.sin(q)
        rub = coulomb + share * abs(drive + weight) / 2
        return v, (drive - weight - viscous * v - rub * np.tanh(v / 0.003)) / inertia

    done = solve_ivp(motion, (0, time[-1]), (0, 0), "LSODA", time, rtol=1e-6, max_step=0.005)
    angle = np.round(done.y[0] / (2 * np.pi / 4096)) * 2 * np.pi / 4096
    about = {"mass": 0.49, "length": 0.1, "kp": kp, "vin": 7.4}
    return about, {"time": time, "position": angle, "goal_position": goal,
                   "torque_enable": np.ones_like(time), "speed": done.y[1]}  # fmt: skip


def jaw(frequency, load, friction, shaft, cable, spring, seconds=16.0, seed=0):
    """A jaw of which nothing has inertia, by the play operator: the hinge slides only as far as it must."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 0.005)
    spindle = 0.5 * (1 - np.cos(2 * np.pi * frequency * time + 0.4))
    torque = -load * (1 + 0.3 * np.sin(2 * np.pi * 0.07 * time))
    per_turn, zero = 0.92, 1.4
    hinge, at = np.empty_like(time), 0.0
    for k, (s, asked) in enumerate(zip(spindle, per_turn * torque, strict=True)):
        slack = 1 / shaft + spring
        high, low = ((s / shaft - asked + f) / slack for f in (friction, -friction))
        at = np.clip(at, low, high) if k else low
        hinge[k] = at
    angle = zero - per_turn * hinge + cable * torque + 4e-4 * rng.standard_normal(time.size)
    felt = -(spindle - hinge) / shaft + 3e-4 * rng.standard_normal(time.size)
    return {"frequency_hz": frequency}, {
        "time": time, "spindle_position": spindle, "spindle_torque": felt, "jaw_position": angle,
        "jaw_torque": torque,
    }  # fmt: skip
