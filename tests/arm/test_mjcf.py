"""Test that the committed models are those that the code builds, and need no other file."""

import mujoco
import numpy as np
import pytest

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_MOTORS


@pytest.fixture(scope="module")
def rebuilt(tmp_path_factory):
    folder = tmp_path_factory.mktemp("model")
    return folder, [path.relative_to(folder) for path in mjcf.write(folder)]


def test_committed_models_are_what_the_code_builds(rebuilt):
    """Text to the letter, meshes byte by byte; `python -m serpent_twin.mjcf` brings them in line."""
    folder, names = rebuilt
    for name in names:
        committed = mjcf.MODEL / name
        assert committed.exists(), f"{name} is not in model/"
        assert committed.read_bytes() == (folder / name).read_bytes(), f"{name} differs"


def test_nothing_else_lies_among_the_meshes(rebuilt):
    _, names = rebuilt
    committed = {path.relative_to(mjcf.MODEL) for path in (mjcf.MODEL / "assets").glob("*")}
    assert committed == {name for name in names if name.parts[0] == "assets"}


@pytest.mark.parametrize("file", ["serpent.xml", "scene.xml"])
def test_the_file_alone_moves_like_the_twin(file):
    """No Python: the XML in plain MuJoCo against the model that simulations use, 2 s of driving."""
    ends = []
    for model in (mujoco.MjModel.from_xml_path(str(mjcf.MODEL / file)), mjcf.build().compile()):
        data = mujoco.MjData(model)
        data.ctrl[0::2] = np.linspace(-0.5, 0.5, N_MOTORS)
        mujoco.mj_step(model, data, 1000)
        assert data.warning.number.sum() == 0
        ends.append(data.qpos.copy())
    assert np.abs(ends[0][10:]).max() > 0.05
    assert np.abs(ends[0] - ends[1]).max() < (1e-6 if file == "serpent.xml" else 1e-3)


def test_the_scene_draws_every_cable():
    model = mujoco.MjModel.from_xml_path(str(mjcf.MODEL / "scene.xml"))
    strands = [model.tendon(name).id for name in mjcf.STRANDS]
    drawn = sorted(set(range(model.ntendon)) - set(strands))
    assert len(drawn) == len(strands)
    assert (model.tendon_stiffness[drawn] == 0).all()
    assert (model.tendon_damping[drawn] == 0).all()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert (data.ten_wrapnum[drawn] > 2).all()


def test_what_is_drawn_weighs_and_touches_nothing():
    drawn = mujoco.MjModel.from_xml_path(str(mjcf.MODEL / "serpent.xml"))
    bare = mjcf.build().compile()
    assert drawn.ngeom > 20
    assert np.array_equal(drawn.body_mass, bare.body_mass)
    assert np.array_equal(drawn.body_inertia, bare.body_inertia)
    assert not drawn.geom_contype.any() and not drawn.geom_conaffinity.any()


def test_coordinates_are_motors_then_joints_then_jaw():
    model = mjcf.build().compile()
    names = [model.joint(i).name for i in range(model.njnt)]
    motors = [f"motor{j}" for j in range(1, 11)]
    assert names == motors + [f"joint{i}" for i in range(1, 10)] + ["jaw"]
    assert [model.actuator(i).name for i in range(10)] == motors
