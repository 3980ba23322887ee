"""Test that the drawn parts are whole, in their places, and without effect on the physics."""

from itertools import pairwise

import mujoco
import numpy as np
import pytest

from serpent_twin.arm import meshes, mjcf, routing, solids
from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS, link_frames

PARTS = meshes.parts(ARM)
SIDES = [(j, name) for j in range(N_MOTORS) for name in routing.SIDES]


@pytest.fixture(scope="module")
def drawn():
    return mjcf.build(drawn=True).compile()


def polygon_area(radius, n):
    return n / 2 * radius**2 * np.sin(2 * np.pi / n)


def test_every_solid_is_watertight_and_points_outwards():
    for part in PARTS:
        pieces = part.mesh.split(only_watertight=False)
        assert all(piece.is_watertight and piece.volume > 0 for piece in pieces), part.name
        assert np.isclose(sum(piece.volume for piece in pieces), part.mesh.volume), part.name


def test_volumes_of_solids_against_closed_forms():
    ring = solids.lathe([(0.01, 0), (0.02, 0), (0.02, 0.003), (0.01, 0.003)], 40)
    assert np.isclose(ring.volume, 0.003 * (polygon_area(0.02, 40) - polygon_area(0.01, 40)))
    plain = solids.disc(0.02, 0.0, 0.01, n=30, chamfer=1e-12)
    assert np.isclose(plain.volume, 0.01 * polygon_area(0.02, 30))
    bar = solids.strut([(0.0, 0, 0, 0.02, 0.01), (0.1, 0, 0, 0.02, 0.01)], corner=0.0)
    assert np.isclose(bar.volume, 0.1 * 0.02 * 0.01, rtol=1e-5)
    frustum = solids.strut([(0.0, 0, 0, 0.02, 0.02), (0.1, 0, 0, 0.01, 0.01)], corner=0.0)
    assert np.isclose(frustum.volume, 0.1 / 3 * (4 + 2 + 1) * 1e-4, rtol=2e-3)
    hoop = solids.hoop(0.0, 0.01, (0.04, 0.04), (0.03, 0.03))
    assert 0.8 < hoop.volume / (0.01 * (0.04**2 - 0.03**2)) < 1.0  # rounded, chamfered


def test_a_beam_reaches_from_point_to_point():
    start, end = np.array([0.01, -0.02, 0.03]), np.array([0.04, 0.02, 0.15])
    mesh = solids.beam(start, end, 0.004)
    along = (end - start) / np.linalg.norm(end - start)
    reach = (mesh.vertices - start) @ along
    assert np.allclose([reach.min(), reach.max()], [0.0, float(np.linalg.norm(end - start))])
    assert np.allclose(mesh.center_mass, (start + end) / 2)


def test_the_robot_has_its_published_size():
    origin, _ = link_frames(np.zeros(N_JOINTS))
    at = {f"link{i + 1}": origin[i] for i in range(N_JOINTS)}
    at |= {f"motor{j + 1}": place for j, place in enumerate(ARM.motor_place)}
    at |= {"base": np.zeros(3), "jaw": origin[-1] + [ARM.jaw_joint, 0, 0]}
    robot = [part for part in PARTS if not part.name.endswith("_marker")]
    bounds = np.array([part.mesh.bounds + at[part.body] for part in robot])
    size = bounds[:, 1].max(0) - bounds[:, 0].min(0)
    assert np.allclose(size, ARM.robot_size, atol=1e-6)
    assert np.isclose(bounds[:, 1, 0].max(), sum(ARM.link_length))


@pytest.mark.parametrize("link", range(N_JOINTS))
def test_the_stack_on_an_axle_is_centred_and_as_high_as_its_pulleys(link):
    stack = next(part.mesh for part in PARTS if part.name == f"link{link + 1}_pulleys")
    height = (N_MOTORS - link) * ARM.pulley_thickness
    low, high = stack.bounds[:, 2 if link % 2 == 0 else 1]
    assert np.allclose([low, high], [-height / 2, height / 2])
    rim = np.abs(stack.bounds[:, 0]).max()
    assert ARM.pulley_radius[link] < rim < ARM.pulley_radius[link] + 0.001


def test_a_strand_lies_in_its_pulley_s_groove():
    for motor in range(N_MOTORS):
        profile = meshes.pulley(ARM, motor).vertices
        radius, height = np.hypot(*profile.T[:2]), profile[:, 2]
        floor = radius[np.isclose(np.abs(height), ARM.groove_distance / 2)]
        assert np.allclose(floor + ARM.cable_diameter / 2, ARM.pulley_radius[motor])


def test_files_stay_small():
    assert sum(84 + 50 * len(part.mesh.faces) for part in PARTS) < 3e6  # binary STL


def test_masses_follow_density_and_steel_axles():
    light, heavy = meshes.volume_mass(ARM, 0.0), meshes.volume_mass(ARM, 1000.0)
    assert list(light) == [*(f"link{i}" for i in range(1, 10)), "jaw"]
    rod = np.pi / 4 * ARM.axle_diameter**2 * 0.045 * meshes.STEEL
    assert np.isclose(light["link1"], rod, rtol=0.25)  # collars besides
    printed = sum(
        part.mesh.volume for part in PARTS if part.name in ("link1_body", "link1_pulleys")
    )
    assert np.isclose(heavy["link1"] - light["link1"], 1000 * printed)
    assert all(a > b for a, b in pairwise(list(heavy.values())[:8]))


@pytest.mark.parametrize("reach", [0.2, routing.DRAWN_REACH])
def test_drawn_strands_change_length_as_the_coupling_says(drawn, reach):
    rng, data = np.random.default_rng(3), mujoco.MjData(drawn)
    ids = [drawn.tendon(f"drawn{j + 1}_{name}").id for j, name in SIDES]
    mujoco.mj_forward(drawn, data)
    straight = data.ten_length[ids].copy()
    side, radius = np.tile([1, -1], N_MOTORS), np.repeat(ARM.pulley_radius, 2)
    for _ in range(20):
        q = data.qpos[N_MOTORS:] = rng.uniform(-reach, reach, N_JOINTS + 1)
        mujoco.mj_forward(drawn, data)
        turned = np.repeat(np.cumsum(q), 2)
        assert np.allclose(data.ten_length[ids] - straight, -side * radius * turned, atol=1e-12)


def test_polylines_are_as_long_as_mujoco_s_cables(drawn):
    data = mujoco.MjData(drawn)
    mujoco.mj_forward(drawn, data)
    for j, name in SIDES:
        side, (x, y, _) = routing.SIDES[name], ARM.motor_place[j]
        lines = routing.pieces(ARM, j, side).values()
        length = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines)
        slanting = side * ARM.pulley_radius[j] * np.arctan2(-y, -x)  # it meets joint 1 at an angle
        wanted = data.ten_length[drawn.tendon(f"drawn{j + 1}_{name}").id]
        assert np.isclose(length + slanting, wanted, rtol=0.004), (j, name)


def test_cables_clear_the_links_frames():
    for link in range(N_JOINTS - 1):
        x0, x1 = meshes.span(ARM, link)
        opening = meshes.half_width(link) - meshes.HOOP_WALL
        for j, name in SIDES[2 * (link + 1) :]:
            a, b = routing.pieces(ARM, j, routing.SIDES[name])[f"link{link + 1}"][-2:]
            share = (np.linspace(x0, x1, 9) - a[0]) / (b[0] - a[0])
            assert np.abs(a[1:] + share[:, None] * (b - a)[1:]).max() < opening - 5e-4


def test_drawing_adds_no_physics(drawn):
    plain = mjcf.build().compile()
    assert plain.nq == drawn.nq and plain.nu == drawn.nu
    assert np.isclose(mujoco.mj_getTotalmass(plain), mujoco.mj_getTotalmass(drawn))
    ends = []
    for model in (plain, drawn):
        data = mujoco.MjData(model)
        for n in range(300):
            data.ctrl[1::2] = 0.5 * np.sin(0.02 * n + np.arange(model.nu // 2))
            mujoco.mj_step(model, data)
        ends.append(data.qpos.copy())
    assert np.abs(ends[0]).max() > 0.01
    assert np.allclose(*ends, atol=1e-9)
