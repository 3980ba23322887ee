"""Known forces on links of the simulated arm, against virtual work, and what a log says of them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.optimize import approx_fprime

from serpent_twin.arm.geometry import N_JOINTS, link_frames
from serpent_twin.arm.mjcf import JOINTS
from serpent_twin.errors import SerpentError
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import examine, read_session
from serpent_twin.sim.pushes import Push, drawn, read
from serpent_twin.sim.twin import Twin

HEAD = "link,begin,end,force_x,force_y,force_z,shape,rate\n"


def pushed_torque(link, force):
    """What a step of force does to the joints' torques in a twin whose joints are bent [N m], (9,), by MuJoCo
    alone; the angles [rad], (9,); and the link's centre of mass in its frame [m], (3,).
    """
    twin = Twin()
    twin.power(True)
    twin.pushes = (Push(link, force, 0.0, 10.0),)
    twin.advance(np.linspace(0.2, 0.5, 10), 0.5)
    data = mujoco.MjData(twin.model)
    data.qpos[:] = twin.qpos[0]
    mujoco.mj_forward(twin.model, data)
    alone = data.qfrc_smooth.copy()
    data.xfrc_applied[:] = twin.batch.bind("xfrc_applied")[0]
    mujoco.mj_forward(twin.model, data)
    joints = [twin.model.joint(name).dofadr[0] for name in JOINTS]
    centre = twin.model.body(f"link{link}").ipos
    return (data.qfrc_smooth - alone)[joints], twin.joint_angle[0], centre


@pytest.mark.parametrize("link", [1, 6, 9])
def test_a_force_does_the_work_that_its_link_s_motion_says(link):
    force = (0.3, -0.7, 0.4)

    def along(q):
        origin, rotation = link_frames(q)
        return float(np.array(force) @ (origin[link - 1] + rotation[link - 1] @ centre))

    torque, angle, centre = pushed_torque(link, force)
    assert torque == pytest.approx(approx_fprime(angle, along), abs=1e-6)
    assert np.abs(torque[link:]).max(initial=0.0) < 1e-9


def test_shapes_follow_their_formulas():
    step, ramp = Push(3, (1, 2, 3), 2, 6), Push(3, (1, 2, 3), 2, 6, "ramp")
    swing = Push(3, (1, 2, 3), 2, 6, "swing", 0.5)
    for each in (step, ramp, swing):
        assert not each.at(1.99).any() and not each.at(6.0).any()
    assert step.at(3.0) == pytest.approx([1, 2, 3])
    assert ramp.at(3.0) == pytest.approx([0.25, 0.5, 0.75])
    assert swing.at(2.5) == pytest.approx([1, 2, 3])
    assert swing.at(3.5) == pytest.approx([-1, -2, -3])


def test_random_pushes_follow_one_another_and_leave_pauses():
    several = drawn(np.random.default_rng(1), 40, 400.0)
    ends = [0.0, *(each.end for each in several)]
    assert all(end <= each.begin < each.end for end, each in zip(ends, several, strict=False))
    sizes = np.linalg.norm([each.force for each in several], axis=1)
    assert sizes.min() >= 0.1 and sizes.max() <= 1.5
    assert {each.shape for each in several} == {"step", "ramp", "swing"}
    assert sum(each.link == N_JOINTS for each in several) >= 12
    assert sum(each.end - each.begin for each in several) < 0.6 * 400


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pushed")
    (folder / "push.csv").write_text(
        HEAD + "9,4,9,0,0.4,0,step,\n3,1,2,0.5,0,0,swing,0.25\n",
    )
    return Collect(folder / "logs", sessions=1, steps=60, push=str(folder / "push.csv"), workers=1)


def test_the_log_says_what_pushed_and_the_arm_yields_to_it(config):
    session = read_session(collect(config)[0])
    free = replace(config, out=config.out.with_name("free"), push="")
    alone = read_session(collect(free)[0])
    link, y = session.extra["push_link"], session.extra["push_y"]
    assert np.array_equal(
        link,
        np.select(
            [(session.time >= 4) & (session.time < 9), (session.time >= 1) & (session.time < 2)],
            [9, 3],
        ),
    )
    assert np.array_equal(y, np.where(link == 9, 0.4, 0.0))
    assert session.extra["push_x"][6] == pytest.approx(0.5 * np.sin(np.pi / 4), abs=1e-6)
    assert np.array_equal(session.joint_target, alone.joint_target)
    off = (session.marker - alone.marker)[:, 8, 1]
    noise = 3 * alone.metadata["config"]["parameters"]["marker_noise"]
    assert np.abs(off[:4]).max() < 2 * noise
    assert off[(session.time > 5) & (session.time < 9)].mean() > noise
    (said,) = [each.text for each in examine(session) if "known force" in each.text]
    assert "in rows 4–7, 16–35: a trace" in said
    assert alone.extra == {} and "push" not in alone.metadata["config"]


def test_the_same_command_pushes_alike(config, tmp_path):
    twice = [
        read_session(collect(replace(config, out=tmp_path / str(n), push="3"))[0]) for n in range(2)
    ]
    for name in ("push_link", "push_z"):
        assert np.array_equal(*(each.extra[name] for each in twice))
    assert np.array_equal(twice[0].marker, twice[1].marker)
    assert len(set(twice[0].extra["push_link"])) > 1


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("10,1,2,0,0,1,step,", "line 2: there is no link 10; links are 1 … 9"),
        ("2.5,1,2,0,0,1,step,", "no link 2.5"),
        ("9,2,1,0,0,1,step,", "lasts from 2 to 1 s"),
        ("9,1,2,0,0,99,step,", "at most 50 N"),
        ("9,1,2,0,x,1,step,", "no number"),
        ("9,1,2,0,0,1,pulse,", "no shape 'pulse'.*step, ramp and swing"),
        ("9,1,2,0,0,1,swing,", "needs a rate"),
        ("9,1,5,0,0,1,step,\n3,4,6,0,0,1,step,", "begins at 4 s, before that of 1 s ends"),
    ],
)
def test_a_push_that_cannot_be_is_refused_by_its_line(line, says, tmp_path):
    (tmp_path / "push.csv").write_text(HEAD + line + "\n")
    with pytest.raises(SerpentError, match=says):
        read(tmp_path / "push.csv")


def test_a_table_without_what_a_push_needs_is_refused(tmp_path):
    (tmp_path / "push.csv").write_text("link,begin,end\n9,1,2\n")
    with pytest.raises(SerpentError, match="lacks force_x, force_y, force_z and shape"):
        read(tmp_path / "push.csv")
    with pytest.raises(SerpentError, match=r"nothing\.csv"):
        collect(Collect(tmp_path / "logs", push=str(tmp_path / "nothing.csv")))
    assert not (tmp_path / "logs").exists()
