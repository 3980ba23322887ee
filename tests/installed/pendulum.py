"""Write a machine in a folder: a pendulum that a servo turns, its machine.toml and CSV logs of a true one.

It needs MuJoCo and numpy alone, so that it runs where only the wheel is installed.
"""

import sys
from pathlib import Path

import mujoco
import numpy as np

MODEL = """<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="rod">
      <joint name="hinge" axis="0 1 0" damping="{damping}" armature="0.002"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.01" mass="0.2"/>
    </body>
  </worldbody>
  <actuator>
    <position name="servo" joint="hinge" kp="4" kv="0.2"/>
  </actuator>
</mujoco>
"""
MACHINE = """schema_version = 1
model = "robot.xml"
rows = "motion"
time = { column = "time", unit = "s" }

[[drive]]
actuator = "servo"
column = "goal"

[[measured]]
joint = "hinge"
columns = ["angle"]
unit = "rad"
noise = 0.0003  # [rad] as added here
"""
EVERY, ROWS = 5, 1000  # rows of 10 ms, 10 s


def log(rng: np.random.Generator) -> np.ndarray:
    """Time [s], goal and measured angle [rad] of a pendulum with twice the damping."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(damping=0.04))
    data, rows = mujoco.MjData(model), []
    for n in range(ROWS):
        if n % 80 == 0:
            data.ctrl[0] = rng.uniform(-0.8, 0.8)
        seen = data.qpos[0] + 3e-4 * rng.standard_normal()
        rows.append((data.time, data.ctrl[0], seen))
        mujoco.mj_step(model, data, EVERY)
    return np.array(rows)


def main(folder: Path) -> None:
    """Write all files."""
    (folder / "logs").mkdir(parents=True)
    (folder / "robot.xml").write_text(MODEL.format(damping=0.02))
    (folder / "machine.toml").write_text(MACHINE)
    rng = np.random.default_rng(1)
    for run in (1, 2, 3):
        table = log(rng)
        path = folder / "logs" / f"run_{run}.csv"
        np.savetxt(path, table, "%.6f", ",", header="time,goal,angle", comments="")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
