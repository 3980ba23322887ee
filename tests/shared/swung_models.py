"""Make logs of a lever on a servo, by an equation of motion that knows nothing of MuJoCo."""

from pathlib import Path

import numpy as np
from example import Example, table
from scipy.integrate import solve_ivp

MASS, LENGTH, GAIN, DAMPING = 0.3, 0.25, 4.0, 0.12  # [kg], [m], [N m/rad], [N m s/rad]
RATE, NOISE = 25.0, 5e-4  # [Hz], [rad]
_INERTIA = MASS * LENGTH**2 + 2 / 5 * MASS * 0.01**2  # of a sphere
MJCF = """<mujoco>
  <option timestep="0.004" integrator="implicitfast"/>
  <worldbody>
    <body name="lever" pos="0 0 1">
      <joint name="pivot" axis="0 1 0" damping="0.12" range="-120 120"/>
      <geom type="sphere" size="0.01" mass="0.3" pos="0 0 -0.25" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="pivot" kp="4" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "lever.xml"
rows = "motion"
time = { column = "t_ms", unit = "ms" }
drive = [{ actuator = "servo", column = "goal_deg", unit = "deg", scale = -1 }]
measured = [{ joint = "pivot", columns = ["angle"], unit = "rad", noise = 0.0005 }]
"""


def slow(seed: int, seconds: float) -> np.ndarray:
    """Goals of one slow turn after another [rad], (T,)."""
    time = np.arange(0.0, seconds, 1 / RATE)
    return 0.5 * np.sin(2 * np.pi * (0.25 + 0.02 * seed) * time)


def log(path: Path, goals: np.ndarray, seed: int, friction=0.0, late=0.0, play=0.0) -> Path:
    """Write the log of goals [rad], (T,), held for a row each, as CSV with noise of 0.5 mrad: the lever has
    Coulomb friction [N m], and the servo obeys late [s] and has play [rad].
    """
    time = np.arange(len(goals)) / RATE
    reached, at = np.empty_like(goals), goals[0]
    for n, goal in enumerate(goals):
        at = np.clip(at, goal - play / 2, goal + play / 2)
        reached[n] = at

    def rates(t, state):
        angle, rate = state
        row = int(max(np.floor((t - late) * RATE + 1e-9), 0))
        servo = GAIN * (reached[min(row, len(goals) - 1)] - angle) - DAMPING * rate
        weight = -MASS * 9.81 * LENGTH * np.sin(angle)
        return [rate, (servo + weight - friction * np.tanh(rate / 1e-3)) / _INERTIA]

    start = [goals[0] * GAIN / (GAIN + MASS * 9.81 * LENGTH), 0.0]
    found = solve_ivp(
        rates, (0, time[-1]), start, "LSODA", time, rtol=1e-7, atol=1e-9, max_step=1 / RATE
    )
    seen = found.y[0] + NOISE * np.random.default_rng(seed).standard_normal(len(time))
    rows = np.c_[1e3 * time, -np.degrees(goals), seen]
    return table(path, "t_ms,goal_deg,angle", rows, 7)


EXAMPLE = Example(MJCF, TOML, log)
machine, opened = EXAMPLE.write, EXAMPLE.opened
