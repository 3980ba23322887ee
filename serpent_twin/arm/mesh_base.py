"""Build the meshes of the base, its ten servos and their winches."""

import itertools

import numpy as np
import trimesh

from serpent_twin.arm import meshes
from serpent_twin.arm.geometry import N_MOTORS, Arm
from serpent_twin.arm.meshes import NYLON, Part, part
from serpent_twin.arm.solids import beam, block, disc, hoop, joined, placed

_FRAME, _SERVO, _HORN, _WINCH, _BOARD = (
    (0.30, 0.33, 0.37),
    (0.14, 0.145, 0.155),
    (0.62, 0.64, 0.67),
    (0.80, 0.80, 0.78),
    (0.10, 0.30, 0.22),
)
_FACE = -0.0175  # [m] height of the servos' faces, under the lowest winch
_WALL = 0.004  # [m] thickness of plates
_HORN_AT = 0.01125  # [m] horn's axis from the near end of the case, assumed
_FRONT = -0.0235  # [m] the front plate ends here, clear of joint 1's pulleys


def base_parts(arm: Arm) -> list[Part]:
    """The base: frame with joint 1's outer cheeks, servo cases, board."""
    return [
        part("base_frame", "base", _FRAME, NYLON, _tray(arm), _truss(arm), _clevis(arm)),
        part("base_servos", "base", _SERVO, 0.0, *[_case(arm, j) for j in range(N_MOTORS)]),
        part("base_board", "base", _BOARD, 0.0, _board(arm)),
    ]


def motor_parts(arm: Arm) -> list[Part]:
    """Horn, and shaft with winch, of each motor, in its own frame: the winch at the origin."""
    found = []
    for j in range(N_MOTORS):
        name, drop = f"motor{j + 1}", _FACE - arm.motor_place[j][2]
        found.append(part(f"{name}_horn", name, _HORN, 0.0, _horn(drop)))
        found.append(part(f"{name}_winch", name, _WINCH, NYLON, _winch(arm, j, drop)))
    return found


def _extent(arm: Arm) -> tuple[float, float, float, float]:
    """Rear end along x, half width along y, bottom and top along z [m]."""
    size = np.array(arm.robot_size)
    bottom = _FACE - arm.servo.size[2] - _WALL
    return sum(arm.link_length) - size[0], size[1] / 2, bottom, bottom + size[2]


def _tray(arm: Arm) -> trimesh.Trimesh:
    """Floor, front plate with the cables' window, rear plate."""
    rear, half, bottom, top = _extent(arm)
    floor = block((rear, -half, bottom), (_FRONT, half, bottom + _WALL))
    outer, lift = (2 * half, top - bottom), (top + bottom) / 2
    front = hoop(_FRONT - _WALL, _FRONT, outer, (0.074, 0.034), lift)
    back = block((rear, -half, bottom), (rear + _WALL, half, top), 0.004)
    return joined(floor, front, back)


def _truss(arm: Arm) -> trimesh.Trimesh:
    """The two open sides: a sill, a rail, posts and diagonals."""
    rear, half, bottom, top = _extent(arm)
    low, high, y = bottom + 0.004, top - 0.003, half - 0.003
    stations = np.linspace(rear + _WALL, _FRONT - _WALL, 7)
    bars = []
    for side in (y, -y):
        bars += [beam((stations[0], side, z), (stations[-1], side, z), 0.006) for z in (low, high)]
        bars += [beam((x, side, low), (x, side, high), 0.005) for x in stations[1:-1]]
        for k, (a, b) in enumerate(itertools.pairwise(stations)):
            start, end = (low, high) if k % 2 else (high, low)
            bars.append(beam((a, side, start), (b, side, end), 0.004))
    bars += [beam((x, -y, high), (x, y, high), 0.005) for x in stations[1:-1:2]]
    return joined(*bars)


def _clevis(arm: Arm) -> trimesh.Trimesh:
    """Joint 1's outer cheeks, standing on the front plate."""
    back = np.diag([-1.0, -1.0, 1.0])
    return placed(meshes.fork(arm, 0, True, (-_FRONT, 0.0235)), back)


def _case(arm: Arm, motor: int) -> trimesh.Trimesh:
    """One servo's case, its long side along x."""
    (length, width, height), (x, y, _) = arm.servo.size, arm.motor_place[motor]
    rear, front = x + _HORN_AT - length, x + _HORN_AT
    bottom, seam = _FACE - height, _FACE - 0.009
    body = block((rear, y - width / 2, bottom), (front, y + width / 2, seam - 4e-4), 0.002)
    inset = 7e-4
    cap = block(
        (rear + inset, y - width / 2 + inset, seam - 0.001),
        (front - inset, y + width / 2 - inset, _FACE),
        0.002,
    )
    return joined(body, cap)


def _horn(drop: float) -> trimesh.Trimesh:
    """The horn's disc with its four screws; the servo's face lies at height `drop`."""
    plate = disc(0.0098, drop, drop + 0.0022, 32)
    screw = disc(0.0014, drop + 0.002, drop + 0.0033, 10, 3e-4)
    around = [(0.0065, 0), (0, 0.0065), (-0.0065, 0), (0, -0.0065)]
    return joined(plate, *[placed(screw, to=(*xy, 0)) for xy in around])


def _winch(arm: Arm, motor: int, drop: float) -> trimesh.Trimesh:
    """Shaft and winch; a ridge on top shows how far it has turned."""
    half, r = arm.pulley_thickness / 2, arm.pulley_radius[motor]
    shaft = disc(0.0033, drop + 0.002, half + 0.001, 20)
    ridge = beam((0, 0, half + 2e-4), (r, 0, half + 2e-4), 0.0014)
    return joined(shaft, meshes.pulley(arm, motor), ridge)


def _board(arm: Arm) -> trimesh.Trimesh:
    """The power and bus board behind the servos."""
    rear, _, bottom, _ = _extent(arm)
    x, z = rear + _WALL + 0.003, bottom + _WALL + 0.002
    card = block((x, -0.024, z), (x + 0.0016, 0.024, z + 0.034), 4e-4)
    plug = block((x + 0.0016, -0.018, z + 0.006), (x + 0.008, -0.006, z + 0.016), 6e-4)
    return joined(card, plug, placed(plug, to=(0, 0.020, 0.004)))
