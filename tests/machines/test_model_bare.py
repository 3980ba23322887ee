"""Test that a model without what is only drawn moves as it does with it."""

import mujoco
import numpy as np
import pytest

from serpent_twin.machines.model.bare import bare

MJCF = """<mujoco>
  <option {fluid}/>
  <asset>
    <mesh name="shell" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 0.1" pos="0 0 -2"/>
    <site name="a" pos="0 0.3 0"/>
    <body name="link">
      <joint name="hinge" axis="0 1 0" damping="0.01"/>
      <inertial mass="0.5" pos="0.2 0 0" diaginertia="0.01 0.01 0.01"/>
      <geom name="drawn" type="mesh" mesh="shell" contype="0" conaffinity="0"/>
      <geom name="pulley" type="sphere" size="0.02" contype="0" conaffinity="0"/>
      <geom name="measured" type="sphere" size="0.02" contype="0" conaffinity="0" pos="0.1 0 0"/>
      <geom name="pair" type="sphere" size="0.02" contype="0" conaffinity="0" pos="0.2 0 0"/>
      <site name="b" pos="0.3 0.1 0"/>
      <body name="lump" pos="0.3 0 0">
        <geom name="weighs" size="0.02" contype="0" conaffinity="0" pos="0.05 0 0"/>
        <geom name="weightless" size="0.02" contype="0" conaffinity="0" mass="0"/>
      </body>
    </body>
  </worldbody>
  <contact><pair geom1="pair" geom2="floor"/></contact>
  <tendon>
    <spatial name="cable" stiffness="20" springlength="0.1">
      <site site="a"/><geom geom="pulley"/><site site="b"/>
    </spatial>
  </tendon>
  <sensor><framepos name="where" objtype="geom" objname="measured"/></sensor>
</mujoco>
"""


def both(fluid=""):
    """The compiled model, and the one without what is only drawn."""
    spec = mujoco.MjSpec.from_string(MJCF.format(fluid=fluid))
    model = spec.compile()
    return model, bare(spec, model).compile()


def swung(model):
    """Angle of the hinge in half a second, which the cable pulls and the mass falls."""
    data, out = mujoco.MjData(model), []
    for _ in range(250):
        mujoco.mj_step(model, data)
        out.append([*data.qpos, *data.sensordata])
    return np.array(out)


def test_it_moves_bit_for_bit_as_the_whole_model_does():
    model, less = both()
    np.testing.assert_array_equal(swung(less), swung(model))
    assert np.ptp(swung(model)[:, 0]) > 0.5


def test_what_acts_stays():
    """Shapes that touch, weigh, wind a cable or are measured; meshes that only what is gone had are gone."""
    model, less = both()
    names = {less.geom(n).name for n in range(less.ngeom)}
    assert names == {"floor", "pulley", "measured", "pair", "weighs"}
    assert model.nmesh == 1 and less.nmesh == 0


@pytest.mark.parametrize("fluid", ['density="1.2"', 'viscosity="1e-5"'])
def test_a_fluid_pushes_all_shapes(fluid):
    model, less = both(fluid)
    assert less.ngeom == model.ngeom
    np.testing.assert_array_equal(swung(less), swung(model))
