"""Make logs of a two-link arm whose shoulder is moved as told, by equations that know nothing of MuJoCo."""

from pathlib import Path

import numpy as np
from example import Example, table
from posed_models import LENGTHS, MASSES
from scipy.integrate import solve_ivp

RATE, SECONDS = 50.0, 8.0  # [Hz], [s]
DAMPING = 0.03  # of the elbow [N m s/rad]
MJCF = """<mujoco>
  <option timestep="0.004" integrator="implicitfast"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" damping="0.1" range="-180 180"/>
      <geom type="sphere" size="0.01" mass="0.4" pos="0.3 0 0" contype="0" conaffinity="0"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.03"/>
        <geom type="sphere" size="0.01" mass="0.25" pos="0.25 0 0" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator><position name="at_shoulder" joint="shoulder" kp="4"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "motion"
time = { column = "t", unit = "s" }

[[drive]]
joint = "shoulder"
column = "encoder"
unit = "rad"

[[measured]]
joint = "elbow"
columns = ["angle"]
unit = "rad"
noise = 0.0005
"""


def turning(rng: np.random.Generator, sharp: float = 0.0):
    """Angle, rate and acceleration of the shoulder over time, sums of sines; to and fro at even speeds, with
    corners of so many seconds, where `sharp` is given.
    """
    size, speed, phase = (rng.uniform(*of, 3) for of in ((0.1, 0.4), (1.0, 5.0), (0.0, 6.0)))

    def smooth(t):
        s = speed * t + phase
        return (size * np.sin(s)).sum(), (size * speed * np.cos(s)).sum(), -(
            size * speed**2 * np.sin(s)
        ).sum()  # fmt: skip

    def even(t, period=1.6, speed=1.0):
        s, v, a = 0.0, -speed, 0.0
        for k in range(12):
            u = (t - (k + 0.5) * period / 2) / sharp
            way = 2 * speed * (-1) ** k
            s += way * sharp * np.logaddexp(0.0, u)
            v += way / (1 + np.exp(-np.clip(u, -700, 700)))
            a += way / sharp / (4 * np.cosh(np.clip(u / 2, -300, 300)) ** 2)
        return s - speed * t, v, a

    return even if sharp else smooth


def swing(time, told, spring=0.0, start=(1.3, 0.0), push=None):
    """Angles of the elbow [rad], (T,), which the shoulder's motion and weight swing, and a torque [N m] that
    follows its angle.
    """
    m2, (a, b) = MASSES[1], LENGTHS

    def rates(t, state):
        q, v = state
        q1, v1, a1 = told(t)
        c, s = np.cos(q), np.sin(q)
        inertia = m2 * b**2 + 2 / 5 * 1e-4 * m2  # of the sphere
        beside = inertia + m2 * a * b * c
        weight = 9.81 * m2 * b * np.cos(q1 + q)  # about +y, angles turn downwards
        moment = weight - m2 * a * b * s * v1**2 - spring * q - DAMPING * v
        moment += push(q) if push else 0.0
        return [v, (moment - beside * a1) / inertia]

    found = solve_ivp(
        rates, (0, time[-1]), start, "LSODA", time, rtol=1e-8, atol=1e-10, max_step=0.005
    )
    return found.y[0]


def log(path: Path, seed: int, spring=0.0, sharp=0.0, noise=5e-4, push=None) -> Path:
    """Write a motion as CSV, with noise of both angles [rad]."""
    rng = np.random.default_rng(seed)
    told, time = turning(rng, sharp), np.arange(0.0, SECONDS, 1 / RATE)
    seen = np.array([[told(t)[0] for t in time], swing(time, told, spring, push=push)]).T
    rows = np.c_[time, seen + noise * rng.standard_normal(seen.shape) * [0.2, 1.0]]
    return table(path, "t,encoder,angle", rows, 8)


EXAMPLE = Example(MJCF, TOML, log)
machine, opened = EXAMPLE.write, EXAMPLE.opened
