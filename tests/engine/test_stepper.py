"""Test that runs side by side cost no more than their physics."""

import mujoco

from serpent_twin.engine.stepper import side_by_side

MODEL = """<mujoco><worldbody><body><joint name="a"/><geom size="0.1" mass="1"/>
<body pos="0 0 1"><joint name="b"/><geom size="0.1" mass="1"/></body></body></worldbody></mujoco>"""


def test_the_clock_is_not_read_in_each_step():
    model = mujoco.MjModel.from_xml_string(MODEL)
    side_by_side([model] * 2, 1)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 50)
    assert data.time > 0 and data.timer[0].duration == 0


def test_one_tree_has_no_islands_to_search():
    model = mujoco.MjModel.from_xml_string(MODEL)
    assert model.ntree == 1
    side_by_side([model] * 2, 1)
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ISLAND
