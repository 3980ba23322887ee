"""Test which numbers of a model a calibration changes together: those of copies of one part."""

from example import Example

from serpent_twin.machines.model.coordinates import coordinates
from serpent_twin.machines.model.reading import read

MJCF = """<mujoco>
  <worldbody>
    <body name="stand"><geom type="box" size=".1 .1 .1" mass="0.5"/></body>
    <body name="left" pos="0 .2 0">
      <joint name="hip_left" axis="0 1 0" damping="0.1" armature="0.01"/>
      <geom type="box" size=".05 .02 .1" pos="0 .03 0" mass="0.5"/>
      <body name="foot" pos="0 0 -.2">
        <joint name="ankle" axis="0 1 0" damping="0.1" armature="0.002"/>
        <geom size=".03" mass="0.5"/>
      </body>
    </body>
    <body name="right" pos="0 -.2 0">
      <joint name="hip_right" axis="0 1 0" damping="0.1" armature="0.01"/>
      <geom type="box" size=".05 .02 .1" pos="0 -.03 0" mass="0.5"/>
    </body>
    <body name="cart" pos="1 0 0">
      <joint name="rail" type="slide" axis="1 0 0" damping="0.1" armature="0.01"/>
      <geom size=".07" mass="0.4"/>
    </body>
  </worldbody>
  <actuator>
    <position name="hip_left" joint="hip_left" kp="20"/>
    <position name="hip_right" joint="hip_right" kp="20"/>
    <position name="rail" joint="rail" kp="20"/>
    <position name="ankle" joint="ankle" kp="20" forcerange="-1 1"/>
  </actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "robot.xml"
rows = "motion"
time = { column = "t", unit = "s" }
drive = [
    { actuator = "hip_left", column = "a", unit = "rad" },
    { actuator = "hip_right", column = "b", unit = "rad" },
    { actuator = "rail", column = "c", unit = "m" },
    { actuator = "ankle", column = "d", unit = "rad" },
]
measured = [{ joint = "ankle", columns = ["e"], unit = "rad" }]
"""


def test_copies_of_one_part_change_together_and_what_happens_to_be_equal_does_not(tmp_path):
    """A body that is fixed to the world has no mass that a motion could show."""
    Example(MJCF, TOML).write(tmp_path)
    found = {each.declared.name for each in coordinates(read(tmp_path / "machine.toml"))}
    for number, moved in (
        ("mass", "left"),
        ("armature", "hip_left"),
        ("actuator gain", "hip_left"),
    ):
        assert f"{number} of 2 alike from {moved}" in found
    apart = ("mass of foot", "mass of cart", "armature of ankle", "armature of rail")
    assert {*apart, "joint damping of rail", "actuator gain of rail"} <= found
    assert "joint damping of ankle" in found and "actuator gain of ankle" in found
    assert not any("stand" in name for name in found)
