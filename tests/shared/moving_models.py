"""Make logs of a moving two-link arm, by equations of motion that know nothing of MuJoCo."""

from pathlib import Path

import numpy as np
import posed_models
from example import Example, table
from posed_models import GAIN, LENGTHS, MASSES, SPRINGS
from scipy.integrate import solve_ivp

DAMPING, RATE, SECONDS = 0.15, 50.0, 8.0  # [N m s/rad], [Hz], [s]
PER_AMPERE = 0.5  # [N m/A]
MJCF = (
    posed_models.MJCF.replace(
        "<worldbody>", '<option timestep="0.004" integrator="implicitfast"/><worldbody>'
    )
    .replace('stiffness="1.5"', 'stiffness="1.5" damping="0.15"')
    .replace('stiffness="0.8"', 'stiffness="0.8" damping="0.15"')
)
TOML = """schema_version = 1
model = "arm.xml"
rows = "motion"
time = { column = "t", unit = "s" }

[[drive]]
actuator = "at_shoulder"
column = "goal_1"
unit = "rad"

[[drive]]
actuator = "at_elbow"
column = "goal_2"
unit = "rad"

[[measured]]
joint = "shoulder"
columns = ["angle_1"]
unit = "rad"
noise = 0.0005

[[measured]]
joint = "elbow"
columns = ["angle_2"]
unit = "rad"
noise = 0.0005
"""
CURRENTS = """
[[measured]]
actuator = "at_shoulder"
columns = ["current_1"]
unit = "N m"
scale = 0.5

[[measured]]
actuator = "at_elbow"
columns = ["current_2"]
unit = "N m"
scale = 0.5
"""
LEVER = """<mujoco>
  <worldbody>
    <body name="lever">
      <joint name="pivot" axis="0 1 0" damping="0.02" stiffness="1"/>
      <geom size="0.01" pos="0.1 0 0" mass="0.2"/>
    </body>
    <body name="wheel" pos="1 0 0">
      <joint name="axle" axis="0 1 0" damping="0.02"/>
      <geom size="0.05" mass="0.2"/>
    </body>
  </worldbody>
  <tendon><fixed name="cable"><joint joint="pivot" coef="0.1"/></fixed></tendon>
  <actuator>
    <position name="winch" tendon="cable" kp="1000" ctrlrange="-0.1 0.1"/>
    <motor name="motor" joint="axle" gear="0.5"/>
  </actuator>
</mujoco>
"""
LEVER_TOML = """schema_version = 1
model = "lever.xml"
time = { column = "time", unit = "s" }
rows = "motion"
drive = [{ actuator = "winch", column = "pulled", unit = "m" }, { actuator = "motor", column = "current" }]
measured = [
    { joint = "pivot", columns = ["angle_1"], unit = "rad" },
    { joint = "axle", columns = ["angle_2"], unit = "rad" },
]
"""


def log(path: Path, seed: int, friction=0.0, at_tip=0.0, late=0.0, stop=0.0) -> Path:
    """Write a motion as CSV, with noise of 0.5 mrad, and of 4 mA in the motors' currents, of 0.5 N m/A, which
    are read before a row's goals are told: the elbow has Coulomb friction [N m] and a bumper [N m/rad] beyond
    0.1 rad, the tip a further mass [kg], and the motors obey late [s].
    """
    rng = np.random.default_rng(seed)
    size, speed, phase = (
        rng.uniform(0.2, 0.5, (3, 2)),
        rng.uniform(0.5, 4, (3, 2)),
        rng.uniform(0, 6, (3, 2)),
    )

    def goal(t):
        held = np.floor((t - late) * RATE + 1e-9) / RATE
        return (size * np.sin(speed * max(held, 0.0) + phase)).sum(axis=0)

    def rates(t, state):
        q, v = state[:2], state[2:]
        m1, m2 = MASSES[0], MASSES[1] + at_tip
        a, b = LENGTHS
        c, s = np.cos(q[1]), np.sin(q[1])
        inertia = np.array(
            [
                [(m1 + m2) * a**2 + m2 * b**2 + 2 * m2 * a * b * c, m2 * b**2 + m2 * a * b * c],
                [m2 * b**2 + m2 * a * b * c, m2 * b**2],
            ]
        ) + 2 / 5 * 1e-4 * np.array([[m1 + m2, m2], [m2, m2]])  # of the spheres
        coriolis = m2 * a * b * s * np.array([-2 * v[0] * v[1] - v[1] ** 2, v[0] ** 2])
        down = 9.81 * np.array(  # about +y, angles turn downwards
            [(m1 + m2) * a * np.cos(q[0]) + m2 * b * np.cos(q.sum()), m2 * b * np.cos(q.sum())]
        )
        motors = GAIN * (goal(t) - q) - np.array(SPRINGS) * q - DAMPING * v
        rubs = np.array([0.0, friction * np.tanh(v[1] / 1e-3) + stop * max(q[1] - 0.1, 0.0)])
        return np.r_[v, np.linalg.solve(inertia, motors + down - coriolis - rubs)]

    start = posed_models.rest(goal(0.0), np.array([0.0, 0.0, -9.81]))
    time = np.arange(0.0, SECONDS, 1 / RATE)
    found = solve_ivp(
        rates, (0, SECONDS), [*start, 0, 0], "LSODA", time, rtol=1e-7, atol=1e-9, max_step=1 / RATE
    )
    goals = np.array([goal(t + late) for t in time])
    seen = found.y[:2].T + 5e-4 * rng.standard_normal((len(time), 2))
    torque = GAIN * (np.array([goal(t - 1e-6) for t in time]) - found.y[:2].T)
    current = torque / PER_AMPERE + 4e-3 * rng.standard_normal(torque.shape)
    rows = np.c_[time, goals, seen, current]
    return table(path, "t,goal_1,goal_2,angle_1,angle_2,current_1,current_2", rows, 7)


EXAMPLE = Example(MJCF, TOML, log)
machine, opened = EXAMPLE.write, EXAMPLE.opened
