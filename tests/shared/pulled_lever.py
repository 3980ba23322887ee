"""Make logs of a lever that a cable pulls, by equations of motion that know neither MuJoCo nor effects."""

from pathlib import Path

import numpy as np
from example import Example, table
from scipy.integrate import solve_ivp

RATE, SECONDS = 20.0, 26.0  # [Hz], [s]
MASS, REACH, SIZE, DAMPING, SPRING = 0.2, 0.1, 0.01, 0.08, 1.0  # [kg], [m], [N m s/rad], [N m/rad]
GEAR, GAIN = 0.1, 400.0  # [m/rad], [N/m]
NOISE = 5e-4  # [rad]
MJCF = """<mujoco>
  <option timestep="0.004" integrator="implicitfast"/>
  <worldbody>
    <body name="lever">
      <joint name="pivot" axis="0 1 0" damping="0.08" stiffness="1"/>
      <geom size="0.01" pos="0.1 0 0" mass="0.2"/>
    </body>
  </worldbody>
  <tendon><fixed name="cable"><joint joint="pivot" coef="0.1"/></fixed></tendon>
  <actuator><position name="winch" tendon="cable" kp="400" ctrlrange="-0.1 0.1"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "lever.xml"
time = { column = "t", unit = "s" }
rows = "motion"
segment = 60
uncertain = [{ number = "joint damping", of = ["pivot"] }, { number = "joint stiffness", of = ["pivot"] }]
drive = [{ actuator = "winch", column = "pulled", unit = "m" }]
measured = [{ joint = "pivot", columns = ["angle"], unit = "rad", noise = 0.0005 }]
"""


def nothing(t, q, v, stretch, memory):
    """Further torque [N m], share of the cable's stiffness, share of the spring's, rate of the memory [m/s].

    The stretch is that of the cable [m], which the memory [m] lengthens.
    """
    return 0.0, 1.0, 1.0, 0.0


def log(path: Path, seed: int, law=nothing, noise=NOISE, seconds=SECONDS) -> Path:
    """Write a motion as CSV, of a lever that has a law; `nothing` says what it returns."""
    rng = np.random.default_rng(seed)
    size, phase = rng.uniform(0.01, 0.02, 4), rng.uniform(0, 6, 4)
    speed = rng.uniform((0.1, 0.5, 2.0, 5.0), (0.4, 1.5, 5.0, 9.0))

    def told(t):
        return -0.01 + (size * np.sin(speed * t + phase)).sum()

    def rates(t, state):
        q, v, memory = state
        stretch = GEAR * q - told(np.floor(t * RATE + 1e-9) / RATE) - memory
        torque, cable, spring, slips = law(t, q, v, stretch, memory)
        pull = -GEAR * GAIN * cable * stretch - SPRING * spring * q - DAMPING * v
        weight = MASS * 9.81 * REACH * np.cos(q)  # about +y, angles turn downwards
        inertia = MASS * (REACH**2 + 2 / 5 * SIZE**2)
        return v, (pull + weight + torque) / inertia, slips

    weight = MASS * 9.81 * REACH
    start = (weight + GEAR * GAIN * told(0.0)) / (SPRING + GEAR**2 * GAIN)
    time = np.arange(0.0, seconds, 1 / RATE)
    found = solve_ivp(
        rates, (0, seconds), [start, 0, 0], "LSODA", time, rtol=1e-7, atol=1e-9, max_step=1 / RATE
    )
    seen = found.y[0] + noise * rng.standard_normal(len(time))
    rows = np.c_[time, [told(t) for t in time], seen]
    return table(path, "t,pulled,angle", rows, 8)


EXAMPLE = Example(MJCF, TOML, log)
machine, opened = EXAMPLE.write, EXAMPLE.opened
