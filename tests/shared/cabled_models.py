"""Write a two-link arm that a cable of known length holds, whose length follows from its angles."""

from pathlib import Path

import numpy as np
from example import Example, table
from posed_models import LENGTHS

MJCF = """<mujoco>
  <option timestep="0.004" integrator="{integrator}"/>
  <worldbody>
    <site name="wall" pos="0.05 0 1.05"/>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" damping="0.05" stiffness="1.5"/>
      <geom type="sphere" size="0.01" mass="0.4" pos="0.3 0 0" contype="0" conaffinity="0"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.03" stiffness="0.8"/>
        <geom type="sphere" size="0.01" mass="0.25" pos="0.25 0 0" contype="0" conaffinity="0"/>
        <site name="end" pos="0.05 0 0.04"/>
        <site name="tip" pos="0.25 0 0"/>
      </body>
    </body>
  </worldbody>
  <tendon><spatial name="cable"><site site="wall"/><site site="end"/></spatial></tendon>
  <sensor><tendonpos name="length" tendon="cable"/></sensor>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "{rows}"
time = {{ column = "t", unit = "s" }}

[[drive]]
tendon = "cable"
column = "wound"
unit = "mm"

[[measured]]
site = "tip"
columns = ["x", "y", "z"]
unit = "mm"
cameras = false
noise = 0.1

[[measured]]
sensor = "length"
columns = ["long"]
unit = "mm"
noise = 0.01
"""


def cabled(folder: Path, rows: str, integrator="implicitfast") -> Path:
    """Write the model and its machine.toml; returns the latter's path."""
    return Example(MJCF.format(integrator=integrator), TOML.format(rows=rows)).write(folder)


def lines(path: Path, rows) -> Path:
    """Write a log of rows as CSV; returns its path."""
    return table(path, "t,wound,x,y,z,long", rows, 9)


def span(angles):
    """Length of the cable [m], for angles of both joints [rad]."""
    first, second = angles[0], angles[0] + angles[1]

    def turned(x, z, by):
        return np.array([x * np.cos(by) + z * np.sin(by), z * np.cos(by) - x * np.sin(by)])

    end = turned(LENGTHS[0], 0.0, first) + turned(0.05, 0.04, second)
    return float(np.linalg.norm(end - [0.05, 0.05]))
