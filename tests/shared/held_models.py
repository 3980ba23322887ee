"""Make a two-link arm and logs of its torques, by equations that know nothing of MuJoCo."""

from pathlib import Path

import numpy as np
from example import Example, table

MASSES, LENGTHS, G, PERIOD = (1.2, 0.8), (0.4, 0.3), 9.81, 0.005  # [kg], [m], [m/s²], [s]
MJCF = """<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 -1 0"/>
      <inertial pos="0 0 -0.4" mass="1.2" diaginertia="1e-6 1e-6 1e-6"/>
      <body name="lower" pos="0 0 -0.4">
        <joint name="elbow" axis="0 -1 0"/>
        <inertial pos="0 0 -0.3" mass="0.8" diaginertia="1e-6 1e-6 1e-6"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="at_shoulder" joint="shoulder" gear="50"/>
    <motor name="at_elbow" joint="elbow" gear="30"/>
  </actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "torque"
time = { column = "t", unit = "s" }
measured = [
    { joint = "shoulder", columns = ["q1"], unit = "deg" },
    { joint = "elbow", columns = ["q2"], unit = "deg" },
    { actuator = "at_shoulder", columns = ["i1"], unit = "N m", scale = 0.05 },
    { actuator = "at_elbow", columns = ["i2"], unit = "N m", scale = 0.04 },
]
"""
"""Motors' torques before the gear, by their currents [A] and torque constants [N m/A]"""


def torques(q, v, a, masses=MASSES):
    """Torques of the joints [N m], (T, 2), of a motion: angles from hanging [rad], rates, accelerations."""
    (m1, m2), (l1, l2) = masses, LENGTHS
    c, s = np.cos(q[:, 1]), np.sin(q[:, 1])
    coupled = m2 * l1 * l2
    far = m2 * l2**2
    near = (m1 + m2) * l1**2
    hangs = G * m2 * l2 * np.sin(q.sum(axis=1))
    first = (near + far + 2 * coupled * c) * a[:, 0] + (far + coupled * c) * a[:, 1]
    first -= coupled * s * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2)
    second = (far + coupled * c) * a[:, 0] + far * a[:, 1] + coupled * s * v[:, 0] ** 2
    return np.c_[first + hangs + G * (m1 + m2) * l1 * np.sin(q[:, 0]), second + hangs]


def motion(seed: int, rows: int = 2000):
    """Angles [rad], rates and accelerations, (T, 2), of a sum of five sines for each joint."""
    rng = np.random.default_rng(seed)
    time = PERIOD * np.arange(rows)[:, None, None]
    turns = 2 * np.pi * rng.uniform(0.1, 1.0, (5, 2))
    size, phase = rng.uniform(0.1, 0.4, (5, 2)), rng.uniform(0, 2 * np.pi, (5, 2))
    angle = turns * time + phase
    return (
        (size * np.sin(angle)).sum(axis=1),
        (size * turns * np.cos(angle)).sum(axis=1),
        -(size * turns**2 * np.sin(angle)).sum(axis=1),
    )


def log(
    path: Path, seed: int, more=lambda q, v, a: 0.0, noise=0.01, step=1e-4, rows=2000, coupled=0.0
) -> Path:
    """Write angles in steps of an encoder [rad], and currents with noise [A], of a motion that needs `more`
    torque (T, 2) than the model's. The elbow's motor turns with the shoulder as well if it is `coupled`.
    """
    q, v, a = motion(seed, rows)
    tau = torques(q, v, a) @ [[1, 0], [-coupled, 1]]
    q, v, a = (each @ [[1, coupled], [0, 1]] for each in (q, v, a))  # of the motors
    tau += more(q, v, a)
    current = tau / [50 * 0.05, 30 * 0.04]
    current += noise * np.random.default_rng(seed).standard_normal(current.shape)
    read = step * np.round(q / step) if step else q
    time = PERIOD * np.arange(rows)
    return table(path, "t,q1,q2,i1,i2", np.c_[time, np.degrees(read), current], 9)


EXAMPLE = Example(MJCF, TOML, log)
