"""Make logs of a hanging three-link chain that two cables pull, by statics that know nothing of MuJoCo."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from example import Example, table
from scipy.optimize import root

LENGTHS, MASSES, SPRINGS = (0.2, 0.2, 0.15), (0.2, 0.15, 0.1), (1.5, 1.0, 0.6)
"""Length of each link [m], mass at its end [kg] and stiffness of its joint [N m/rad]"""
STIFFNESS, BEGINS = 60.0, ((-0.4, -0.2), (0.4, -0.3))
"""Stiffness of a cable [N/m], and where each begins, along x and z [m]"""
STRAIGHT = (0.2**0.5, 0.2225**0.5)
"""Lengths of the cables while the chain hangs straight [m]"""
ENDS = (1, 2)
"""Index of the link at whose end each cable ends, from 0"""
LINK = """<body name="link_{n}" pos="0 0 {at}">
      <joint name="joint_{n}" axis="0 1 0" stiffness="{spring}"/>
      <geom type="sphere" size="0.01" mass="{mass}" pos="0 0 -{length}" contype="0" conaffinity="0"/>
      <inertial pos="0 0 -{length}" mass="{mass}" diaginertia="1e-5 1e-5 1e-5"/>
      <site name="end_{n}" pos="0 0 -{length}"/>"""
MJCF = """<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <site name="from_left" pos="-0.4 0 -0.2"/>
    <site name="from_right" pos="0.4 0 -0.3"/>
    {links}
  </worldbody>
  <tendon>
    <spatial name="left"><site site="from_left"/><site site="end_2"/></spatial>
    <spatial name="right"><site site="from_right"/><site site="end_3"/></spatial>
  </tendon>
  <actuator>
    <position name="at_left" tendon="left" kp="60" ctrlrange="0 1" forcerange="-1000 0"/>
    <position name="at_right" tendon="right" kp="60" ctrlrange="0 1" forcerange="-1000 0"/>
  </actuator>
  <keyframe><key name="straight" ctrl="0.4472136 0.4716991"/></keyframe>
</mujoco>
"""
TOML = """schema_version = 1
model = "chain.xml"
rows = "poses"
keyframe = "straight"
segment = 15
drive = [
    { actuator = "at_left", column = "left", unit = "m" },
    { actuator = "at_right", column = "right", unit = "m" },
]
measured = [
    { site = "end_2", columns = ["x2", "y2", "z2"], unit = "m", cameras = false, noise = 0.0002 },
    { site = "end_3", columns = ["x3", "y3", "z3"], unit = "m", cameras = false, noise = 0.0002 },
]
"""
Law = Callable[[np.ndarray], np.ndarray]
"""Torques of the joints [N m], (3,), at their angles [rad], (3,)"""


def ends(q: np.ndarray) -> np.ndarray:
    """The ends of the links and the first joint [m], (4, 2), along x and z."""
    angle = np.cumsum(q)
    steps = -np.array(LENGTHS)[:, None] * np.c_[np.sin(angle), np.cos(angle)]
    return np.r_[[[0.0, 0.0]], np.cumsum(steps, axis=0)]


def lever(q: np.ndarray, link: int) -> np.ndarray:
    """Motion of a link's end [m/rad] with each joint, (2, 3), along x and z."""
    at = ends(q)
    away = at[link + 1] - at[: link + 1]
    out = np.zeros((2, 3))
    out[:, : link + 1] = np.array([away[:, 1], -away[:, 0]])
    return out


def pulls(q: np.ndarray, told: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The cables' tensions [N], (2,), and the torques that they give the joints [N m], (3,)."""
    tension, torque = np.zeros(2), np.zeros(3)
    for k, (begin, link) in enumerate(zip(BEGINS, ENDS, strict=True)):
        along = ends(q)[link + 1] - begin
        length = np.hypot(*along)
        tension[k] = np.broadcast_to(STIFFNESS, 2)[k] * max(length - told[k], 0.0)
        torque -= tension[k] * (along / length) @ lever(q, link)
    return tension, torque


def left_over(q: np.ndarray, told: np.ndarray) -> np.ndarray:
    """The torques that would set the chain in motion [N m], (3,)."""
    weight = sum(m * -9.81 * lever(q, n)[1] for n, m in enumerate(MASSES))
    return weight - np.array(SPRINGS) * q + pulls(q, told)[1]


def rest(told: np.ndarray, law: Law | None = None) -> np.ndarray:
    """Joint angles at rest [rad], (3,), told lengths of the cables [m], (2,); a law sets in bit by bit."""
    law, q = law or (lambda q: 0.0 * q), np.zeros(3)
    for part in np.linspace(0.0, 1.0, 5):
        q = root(lambda x, part=part: left_over(x, told) + part * law(x), q, tol=1e-12).x
    assert np.abs(left_over(q, told) + law(q)).max() < 1e-8
    return q


def shown(q: np.ndarray) -> np.ndarray:
    """What is measured [m], (6,)."""
    x, z = ends(q)[[2, 3]].T
    return np.array([x[0], 0.0, z[0], x[1], 0.0, z[1]])


def machine(folder: Path) -> Path:
    """Write the model and its machine.toml; returns the latter's path."""
    folder.mkdir(parents=True, exist_ok=True)
    links = ""
    for n in range(3):
        at = -LENGTHS[n - 1] if n else 0
        links += LINK.format(n=n + 1, at=at, spring=SPRINGS[n], mass=MASSES[n], length=LENGTHS[n])
    return Example(MJCF.format(links=links + "</body>" * 3), TOML).write(folder)


def log(path: Path, seed: int, law: Law | None = None, poses: int = 45) -> Path:
    """Write poses at random lengths of the cables as CSV, with noise of 0.2 mm."""
    rng = np.random.default_rng(seed)
    told = STRAIGHT - rng.uniform(-0.02, 0.1, (poses, 2))
    seen = np.array([shown(rest(each, law)) for each in told])
    rows = np.c_[told, seen + 2e-4 * rng.standard_normal(seen.shape)]
    return table(path, "left,right,x2,y2,z2,x3,y3,z3", rows, 9)


STOP, BELOW = 1.5, -0.2  # [N m/rad] against the third joint beyond an angle [rad]


def stop(q):
    """A torque on the third joint that grows beyond an angle."""
    return np.array([0.0, 0.0, -STOP * min(q[2] - BELOW, 0.0)])


def pushed(q):
    """A force on the last link that grows as it goes aside."""
    return lever(q, 2).T @ [-8.0 * max(ends(q)[3, 0] - 0.03, 0.0), 0.0]
