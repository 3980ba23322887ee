"""Make small models and logs of their poses at rest, by potential energies that know nothing of MuJoCo."""

from pathlib import Path

import numpy as np
from example import Example, table
from scipy.optimize import minimize

MASSES, LENGTHS, SPRINGS = (0.4, 0.25), (0.3, 0.25), (1.5, 0.8)  # [kg], [m], [N m/rad]
GAIN = 4.0  # [N m/rad]
MJCF = """<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" stiffness="1.5"/>
      <geom type="sphere" size="0.01" mass="0.4" pos="0.3 0 0" contype="0" conaffinity="0"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" stiffness="0.8"/>
        <geom type="sphere" size="0.01" mass="0.25" pos="0.25 0 0" contype="0" conaffinity="0"/>
        <site name="tip" pos="0.25 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="at_shoulder" joint="shoulder" kp="4" ctrlrange="-3 3"/>
    <position name="at_elbow" joint="elbow" kp="4" ctrlrange="-3 3"/>
  </actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "poses"

[[drive]]
actuator = "at_shoulder"
column = "shoulder_deg"
unit = "deg"

[[drive]]
actuator = "at_elbow"
column = "elbow_deg"
unit = "deg"

[[measured]]
site = "tip"
columns = ["x", "y", "z"]
unit = "mm"
cameras = false
noise = 0.3
"""


def places(angles):
    """Both masses [m], (2, 3), the second at the tip."""
    first, second = angles[0], angles[0] + angles[1]
    upper = np.array([np.cos(first), 0.0, -np.sin(first)]) * LENGTHS[0]
    lower = np.array([np.cos(second), 0.0, -np.sin(second)]) * LENGTHS[1]
    return np.array([upper, upper + lower]) + [0.0, 0.0, 1.0]


def rest(goals, gravity, friction=(0.0, 0.0), before=None):
    """Joint angles of least energy [rad], (2,), for goals [rad] under gravity [m/s²], (3,); with friction of
    the joints [N m], of energy and the work against it on the way from other angles.
    """

    def energy(angles):
        springs = sum(k * q**2 for k, q in zip(SPRINGS, angles, strict=True))
        motors = sum(GAIN * (q - g) ** 2 for q, g in zip(angles, goals, strict=True))
        weight = sum(m * (at @ gravity) for m, at in zip(MASSES, places(angles), strict=True))
        return (springs + motors) / 2 - weight

    if before is None or not np.any(friction):
        return minimize(energy, np.asarray(goals) / 2, method="BFGS", options={"gtol": 1e-9}).x
    found = minimize(
        lambda ways: energy(before + ways[:2] - ways[2:]) + ways @ np.tile(friction, 2),
        np.full(4, 1e-3),
        bounds=[(0.0, None)] * 4,
        options={"ftol": 1e-15, "gtol": 1e-10},
    )
    return before + found.x[:2] - found.x[2:]


def log(
    path: Path,
    seed: int,
    gravity=(0.0, 0.0, -9.81),
    poses=60,
    gap=0.0,
    friction=(0.0, 0.0),
    given=lambda goals: goals,
) -> Path:
    """Write poses at random goals as CSV, with noise of 0.3 mm; `gap` is the motors' play [rad], of both or
    of each, `friction` that of the joints [N m];
    `given` makes of the logged goals [rad], (poses, 2), what reaches the motors.
    """
    gap = np.broadcast_to(gap, 2)
    rng = np.random.default_rng(seed)
    goals = rng.uniform(-0.8, 0.8, (poses, 2))
    told = given(goals)
    reached, at = np.empty_like(told), told[0] - gap / 2 * np.sign(told[1] - told[0])
    for n, goal in enumerate(told):
        at = np.clip(at, goal - gap / 2, goal + gap / 2)
        reached[n] = at
    angles = [rest(reached[0], np.array(gravity))]
    for goal in reached[1:]:
        angles.append(rest(goal, np.array(gravity), friction, angles[-1]))
    seen = np.array([places(each)[1] for each in angles])
    seen = 1e3 * seen + 0.3 * rng.standard_normal(seen.shape)
    rows = np.c_[np.degrees(goals), seen]
    return table(path, "shoulder_deg,elbow_deg,x,y,z", rows, 6)


EXAMPLE = Example(MJCF, TOML, log)
machine, opened = EXAMPLE.write, EXAMPLE.opened
