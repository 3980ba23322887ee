"""Build the meshes of the arm's parts, and compute their masses.

The published robot has no drawings: joints, pulleys, axles, servos and overall size are the arm's
numbers; the shapes between them are ours, made to look printable. Metres, each part in the frame of
the body that carries it.
"""

from dataclasses import dataclass

import numpy as np
import trimesh

from serpent_twin.arm import solids
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, Arm
from serpent_twin.arm.solids import beam, block, disc, hoop, joined, placed, strut

NYLON = 1010.0  # [kg/m³] PA12: HP's data sheet of its 3D High Reusability PA 12, 1.01 g/cm³
STEEL = 7850.0  # [kg/m³] carbon steel

_WHITE, _GRAPHITE, _ACCENT = (0.90, 0.89, 0.86), (0.36, 0.39, 0.43), (0.93, 0.45, 0.13)
_METAL, _BALL = (0.72, 0.73, 0.75), (0.85, 0.85, 0.85)

_CHEEK = 0.0030  # [m] thickness of a fork's cheek
HOOP_WALL = 0.0034  # [m] thickness of a link's hoops
_PLAY = 0.0003  # [m] between cheeks
_RIM = 0.0006  # [m] a pulley's rim stands this far above the cable
_TO_EVEN = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z to y: even joints turn about y


@dataclass(frozen=True)
class Part:
    """One rigid piece of one material."""

    name: str
    """Unique; the mesh file's stem"""
    body: str
    """The body that carries it: base, motor1 … motor10, link1 … link9, jaw"""
    mesh: trimesh.Trimesh
    """Surface of the part in the body's frame [m]"""
    rgba: tuple[float, float, float, float]
    """Colour"""
    density: float
    """Density of the part's material [kg/m³]; 0 for what is weighed as a whole or not at all"""


def parts(arm: Arm) -> list[Part]:
    """All parts of the robot, the base first, then motors, links and jaw."""
    from serpent_twin.arm.mesh_base import base_parts, motor_parts  # it imports this module

    links = [part for link in range(N_JOINTS) for part in _link_parts(arm, link)]
    return [*base_parts(arm), *motor_parts(arm), *links, *_jaw_parts(arm)]


def part(
    name: str, body: str, colour: tuple[float, ...], density: float, *pieces: trimesh.Trimesh
) -> Part:
    """A part of several solids."""
    red, green, blue = colour
    return Part(name, body, joined(*pieces), (red, green, blue, 1.0), density)


def volume_mass(arm: Arm, density: float = NYLON) -> dict[str, float]:
    """Mass [kg] of links and jaw if what is printed had `density` [kg/m³]; axles are steel.

    Where a body's solids overlap they count twice: 10 to 15 % of a link's nylon, found by sampling.
    """
    masses: dict[str, float] = {}
    for piece in parts(arm):
        if piece.body.startswith(("link", "jaw")):
            weight = density if piece.density == NYLON else piece.density
            masses[piece.body] = masses.get(piece.body, 0.0) + float(weight * piece.mesh.volume)
    return masses


def stack_height(arm: Arm, joint: int, motor: int) -> float:
    """Where motor 0 … 9's pulley sits on the axle of joint 0 … 8, from the link's middle [m]."""
    return (motor - joint - (N_MOTORS - 1 - joint) / 2) * arm.pulley_thickness


def pulley(arm: Arm, motor: int) -> trimesh.Trimesh:
    """The pulley of a motor's cable, about z, with its two grooves."""
    r, half, groove = arm.pulley_radius[motor], arm.pulley_thickness / 2, arm.groove_distance / 2
    rim, floor, bore = r + _RIM, r - arm.cable_diameter / 2, arm.axle_diameter / 2
    lip = half - 1e-4
    outer = [(rim, -lip), (floor, -groove), (rim, -groove / 2), (rim, groove / 2), (floor, groove)]
    return solids.lathe([(bore, -half), *outer, (rim, lip), (bore, half)], 10 + int(1000 * r))


def half_width(link: int) -> float:
    """Half the outer width of link 0 … 8 [m]: 21.5 mm, tapering to 15.5."""
    return 0.0215 - 0.00075 * link


def cheek(arm: Arm, joint: int) -> float:
    """Where the inner cheeks of joint 0 … 8 begin, from the middle of the axle [m]."""
    stack = (N_MOTORS - joint) * arm.pulley_thickness / 2
    return max(stack + 4e-4, half_width(joint) - 0.0071)


def eye_radius(joint: int) -> float:
    """Radius of the cheeks' eyes around the axle of joint 0 … 8 [m]."""
    return 0.0072 - 0.0002 * joint


def fork(arm: Arm, joint: int, outside: bool, frame: tuple[float, float]) -> trimesh.Trimesh:
    """Two cheeks about z at joint 0 … 8; from its axle to `frame`: x and half width there."""
    start = cheek(arm, joint) + (_CHEEK + _PLAY if outside else 0.0)
    middle, eye = start + _CHEEK / 2, eye_radius(joint)
    x, half = frame
    rows = [(0.0, 0, middle, 1.7 * eye, _CHEEK), (0.45 * x, 0, middle, 1.5 * eye, _CHEEK)]
    rows += [
        (x, 0, half - 0.0016, 1.25 * half, 0.003),
        (1.12 * x, 0, half - 0.0016, 1.25 * half, 0.003),
    ]
    arms = [strut(rows, 6e-4), disc(eye, start, start + _CHEEK)]
    lower = [placed(piece, np.diag([1.0, -1.0, -1.0])) for piece in arms]
    return joined(*arms, *lower)


def _link_parts(arm: Arm, link: int) -> list[Part]:
    name, turn = f"link{link + 1}", np.eye(3) if link % 2 == 0 else _TO_EVEN
    stack = [
        placed(pulley(arm, motor), to=(0, 0, stack_height(arm, link, motor)))
        for motor in range(link, N_MOTORS)
    ]
    body = _tail(arm) if link == N_JOINTS - 1 else _middle(arm, link)
    place = np.array(arm.marker[link])
    ball = trimesh.creation.icosphere(2, 0.0045)
    return [
        part(f"{name}_body", name, _WHITE, NYLON, placed(body, turn), _stalk(arm, link)),
        part(f"{name}_pulleys", name, _GRAPHITE, NYLON, placed(joined(*stack), turn)),
        part(f"{name}_axle", name, _METAL, STEEL, placed(_axle(arm, link), turn)),
        part(f"{name}_marker", name, _BALL, 0.0, placed(ball, to=place)),
    ]


def _axle(arm: Arm, joint: int) -> trimesh.Trimesh:
    reach = cheek(arm, joint) + 2 * _CHEEK + _PLAY
    collar = disc(0.0028, reach, reach + 0.001, 16, 2e-4)
    spacers = []
    stack = (N_MOTORS - joint) * arm.pulley_thickness / 2
    if cheek(arm, joint) > stack + 0.001:
        spacers = [
            disc(0.0025, stack, cheek(arm, joint), 16),
            disc(0.0025, -cheek(arm, joint), -stack, 16),
        ]
    rod = disc(arm.axle_diameter / 2, -reach - 0.0015, reach + 0.0015, 16)
    return joined(rod, collar, placed(collar, to=(0, 0, -2 * reach - 0.001)), *spacers)


def span(arm: Arm, link: int) -> tuple[float, float]:
    """Where the frame of link 0 … 7 begins and ends along x, clear of the pulleys [m]."""
    here, after = arm.pulley_radius[link], arm.pulley_radius[link + 1]
    return max(here + 0.0025, 0.0155), arm.link_length[link] - max(after + 0.0025, 0.0155)


def _middle(arm: Arm, link: int) -> trimesh.Trimesh:
    """Link 0 … 7, its own axis along z, the next along y."""
    (x0, x1), half = span(arm, link), half_width(link)
    rear = fork(arm, link, False, (x0, half))
    length = arm.link_length[link]
    front = fork(arm, link + 1, True, (length - x1, half))
    back = np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]])
    return joined(rear, placed(front, back, (length, 0, 0)), _cage(x0, x1, half))


def _cage(x0: float, x1: float, half: float) -> trimesh.Trimesh:
    """Two hoops and four corner bars, open between: the cables cross here."""
    outer, inner = 2 * half, 2 * half - 2 * HOOP_WALL
    hoops = [hoop(x, x + 0.0045, (outer, outer), (inner, inner)) for x in (x0, x1 - 0.0045)]
    at = half - 0.0036
    corners = [(sy * at, sz * at) for sy in (1, -1) for sz in (1, -1)]
    return joined(*hoops, *[beam((x0 + 1e-3, *c), (x1 - 1e-3, *c), 0.0052) for c in corners])


def _stalk(arm: Arm, link: int) -> trimesh.Trimesh:
    """The post that carries a link's marker, with its bridge over the frame's window."""
    place, half = np.array(arm.marker[link]), half_width(link)
    side = np.array([0, *np.sign(np.round(place[1:], 6))])
    x0, x1 = (0.058, place[0] + 0.004) if link == N_JOINTS - 1 else span(arm, link)
    root = side * (half - 0.0015)
    thick = np.abs(side[[0, 2, 1]]) * 0.0035 + np.abs(side) * 0.0013
    bridge = block([x0, 0, 0] + root - thick, [x1, 0, 0] + root + thick, 8e-4)
    return joined(bridge, beam([place[0], 0, 0] + root, place - side * 0.003, 0.003))


def _tail(arm: Arm) -> trimesh.Trimesh:
    """Link 9: its fork, a cage, the palm with the jaw's hinge, and the fixed finger."""
    last, half = N_JOINTS - 1, half_width(N_JOINTS - 1)
    end, hinge = arm.link_length[-1], arm.jaw_joint
    palm = strut([(0.060, 0, 0, 2 * half, 2 * half), (0.068, 0, 0, 0.030, 0.028)], 0.005)
    lug = block((0.064, 0.007, -0.007), (hinge + 0.005, 0.010, 0.007), 0.002)
    rows = [(0.064, 0, -0.0095, 0.014, 0.006), (hinge - 0.004, 0, -0.0115, 0.014, 0.005)]
    rows += [(hinge + 0.008, 0, -0.0085, 0.013, 0.005), (end - 0.001, 0, -0.0030, 0.011, 0.004)]
    finger = strut([*rows, (end, 0, -0.0028, 0.010, 0.003)], 0.0012)
    frame = [fork(arm, last, False, (0.0155, half)), _cage(0.0155, 0.062, half)]
    return joined(*frame, palm, lug, placed(lug, np.diag([1.0, -1.0, -1.0])), finger)


def _jaw_parts(arm: Arm) -> list[Part]:
    """The moving jaw about y at its hinge, closed at zero: the mirror of the fixed finger."""
    size = arm.link_length[-1] - arm.jaw_joint
    rows = [(-0.004, 0, 0.0065, 0.012, 0.009), (0.008, 0, 0.0085, 0.013, 0.005)]
    rows += [(size - 0.001, 0, 0.0030, 0.011, 0.004), (size, 0, 0.0028, 0.010, 0.003)]
    turn = _TO_EVEN
    hub = placed(pulley(arm, N_MOTORS - 1), turn)
    axle = placed(disc(arm.axle_diameter / 2, -0.011, 0.011, 16), turn)
    return [
        part("jaw_body", "jaw", _ACCENT, NYLON, strut(rows, 0.0012)),
        part("jaw_pulley", "jaw", _GRAPHITE, NYLON, hub),
        part("jaw_axle", "jaw", _METAL, STEEL, axle),
    ]
