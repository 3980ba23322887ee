"""Add light, floor, gantry and camera to the drawn arm."""

import mujoco
import numpy as np


def furnish(spec: mujoco.MjSpec) -> None:
    """Light, sky, floor, the gantry that the robot hangs from, and a camera."""
    spec.visual.headlight.ambient = [0.42, 0.42, 0.43]
    spec.visual.headlight.diffuse = [0.35, 0.35, 0.35]
    spec.visual.headlight.specular = [0.1, 0.1, 0.1]
    spec.visual.global_.azimuth, spec.visual.global_.elevation = 145, -12
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    spec.visual.quality.shadowsize = 8192
    spec.visual.map.znear, spec.visual.map.shadowclip = 0.01, 1.4
    spec.stat.center, spec.stat.extent = [0.0, 0.0, -0.08], 0.9
    _add_ground(spec)
    _add_gantry(spec)
    _add_lights(spec)


def _add_ground(spec: mujoco.MjSpec) -> None:
    builtin, kind = mujoco.mjtBuiltin, mujoco.mjtTexture
    spec.add_texture(
        name="sky", type=kind.mjTEXTURE_SKYBOX, builtin=builtin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.94, 0.95], rgb2=[0.72, 0.76, 0.80], width=256, height=1536,
    )  # fmt: skip
    spec.add_texture(
        name="floor", type=kind.mjTEXTURE_2D, builtin=builtin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE, markrgb=[0.70, 0.72, 0.74],
        rgb1=[0.80, 0.81, 0.83], rgb2=[0.77, 0.78, 0.80], width=512, height=512,
    )  # fmt: skip
    floor = spec.add_material(name="floor", texrepeat=[10, 10], texuniform=True, reflectance=0.05)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
    ground = spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE)
    ground.size, ground.pos, ground.material = [3, 3, 0.1], [0, 0, -0.75], "floor"
    ground.contype = ground.conaffinity = 0


def _add_gantry(spec: mujoco.MjSpec) -> None:
    top, foot, half = 0.424, -0.75, 0.015
    bar = ([0, 0, top + half], [half, 0.68, half])
    posts = [([0, y, (top + foot) / 2], [half, half, (top - foot) / 2]) for y in (-0.665, 0.665)]
    for name, (pos, size) in zip(("beam", "post_left", "post_right"), [bar, *posts], strict=True):
        geom = spec.worldbody.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_BOX, pos=pos, size=size
        )
        geom.rgba, geom.group, geom.contype, geom.conaffinity = [0.62, 0.64, 0.67, 1], 1, 0, 0


def _add_lights(spec: mujoco.MjSpec) -> None:
    for name, pos, strength, shadow in (
        ("key", [0.7, -0.8, 1.8], 0.55, True),
        ("fill", [1.2, 1.4, 0.8], 0.25, False),
    ):
        light = spec.worldbody.add_light(name=name, pos=pos, castshadow=shadow)
        light.dir = -np.array(pos) + [0, 0, -0.1]
        light.diffuse, light.specular = [strength] * 3, [0.15] * 3
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
