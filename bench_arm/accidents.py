"""Define what may happen to one part of an arm, for which no catalogue has a name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array

GIVES_WAY = 0.2  # s, in which a part that slips does so
CORD = 0.05  # m, length of a cord that does not pull yet
REACH = (0.3, 0.1, 0.1)  # m, from the arm's middle to where a cord may end, along each axis
_MIDDLE = 0.25  # m, of the straight arm, from its base


@dataclass(frozen=True)
class Accident:
    """What happened to one part: a law of the running time or of an angle, by its strength."""

    kind: str
    """One of `ACCIDENTS`"""
    strength: float
    """Strength in the unit of its kind"""
    part: int = 1
    """Which joint, link, motor or marker, from 1; of a strand, 0 … 17 as `clamp_strand` counts"""
    direction: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """Direction of a push or a shift, in the base frame; of a marker or a turned link, in the link's"""
    begin: float = 0.1
    """Angle from which on it acts [rad]"""
    width: float = 0.2
    """Width of the window of angles in which it acts [rad]"""
    rate: float = 0.4
    """Frequency of a swing [Hz], or waves of an encoder in a turn"""
    phase: float = 0.0
    """[rad]"""
    instant: float = 0.0
    """Running time at which something gives way, or has died [s]"""
    time_constant: float = 1.0
    """Time constant of what relaxes [s]"""

    @property
    def vector(self) -> Array:
        """Its strength along its direction, (3,)."""
        return self.strength * np.array(self.direction)

    def since(self, clock: Array) -> Array:
        """How far it has given way at running times [s], 0 … 1."""
        return np.clip((clock - self.instant) / GIVES_WAY, 0.0, 1.0)

    def inside(self, angle: Array | float) -> np.ndarray:
        """Whether an angle [rad] lies in its window."""
        return (angle >= self.begin) & (angle <= self.begin + self.width)


ACCIDENTS: Mapping[str, tuple[float, str]] = {
    "swinging_push": (0.3, "a force on a link that swings by the clock [N]"),
    "soft_stop": (0.5, "a bumper: a spring against one joint beyond an angle [N m/rad]"),
    "loose_strand": (6e-4, "a strand that is longer from an instant on [m]"),
    "slipped_winch": (0.06, "a winch that has turned on its horn from an instant on [rad]"),
    "loose_gear": (0.05, "play in the gear of one motor [rad]"),
    "encoder_wave": (0.04, "an encoder that waves, in turns of its horn [rad]"),
    "rubbing_cable": (0.06, "friction of one motor within a window of its angle [N m]"),
    "knocked_marker": (4e-3, "a marker that sits elsewhere on its link from an instant on [m]"),
    "moved_cameras": (3e-3, "cameras whose frame has moved from an instant on [m]"),
    "fading_load": (0.25, "a load sensor that shows a share less [1]"),
    "dying_load": (0.6, "a load sensor that shows less and less, a share less in the end [1]"),
    "elastic_cord": (1.5, "a cord that pulls a link to a fixed point [N/m]"),
    "turned_link": (0.02, "a link that has turned, with all beyond, from an instant on [rad]"),
    "turned_cameras": (0.008, "cameras that have turned from an instant on [rad]"),
    "relaxing_joint": (0.3, "a spring across one joint that relaxes [N m/rad]"),
    "drifting_clock": (2e-4, "cameras whose clock falls behind that of the motors [s/s]"),
    "late_load": (0.06, "one motor's load, which is read late [s]"),
}
"""A strength of each that an arm of this size shows clearly, and what it is"""


def draw(kind: str, strength: float, rng: np.random.Generator, seconds: float) -> Accident:
    """An accident at a part that is drawn, in an arm that runs for so many seconds in all."""
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    parts = {
        "swinging_push": rng.integers(6, N_JOINTS + 1),
        "soft_stop": rng.integers(1, N_JOINTS + 1),
        "loose_strand": rng.integers(6),
        "slipped_winch": rng.integers(1, N_JOINTS + 1),
        "encoder_wave": rng.integers(1, N_JOINTS + 1),
        "rubbing_cable": rng.integers(2, N_JOINTS + 1),
        "knocked_marker": rng.integers(1, N_JOINTS + 1),
        "moved_cameras": 1,
        "fading_load": rng.integers(1, N_JOINTS + 1),
        "dying_load": rng.integers(1, N_JOINTS + 1),
        "elastic_cord": rng.integers(5, N_JOINTS + 1),
        "turned_link": rng.integers(2, N_JOINTS + 1),
        "turned_cameras": 1,
    }
    # Seeds give the arms that they gave before these kinds.
    parts["loose_gear"] = parts["late_load"] = parts["encoder_wave"]
    parts["relaxing_joint"], parts["drifting_clock"] = parts["soft_stop"], 1
    return Accident(
        kind,
        strength,
        int(parts[kind]),
        tuple(direction.tolist()),
        begin=float(rng.uniform(0.02, 0.12)),
        width=float(rng.uniform(0.15, 0.25)),
        rate=float(rng.integers(1, 5)) if kind == "encoder_wave" else float(rng.uniform(0.1, 0.9)),
        phase=float(rng.uniform(-np.pi, np.pi)),
        instant=seconds if kind == "dying_load" else float(rng.uniform(0.2, 0.55)) * seconds,
        time_constant=float(rng.uniform(0.4, 1.6)),
    )


Several = Sequence[tuple[Accident, ...]]
"""Accidents of each row"""


def of_kind(several: Several, kind: str) -> list[tuple[int, Accident]]:
    """Rows that have an accident of a kind, with it."""
    return [(n, each) for n, row in enumerate(several) for each in row if each.kind == kind]


def strand_slack(several: Several, clock: Array, shape: tuple[int, int, int]) -> Array:
    """Lengths by which strands are longer at running times (R,) [s], (R, 2, 9) [m]."""
    out = np.zeros(shape)
    for n, each in of_kind(several, "loose_strand"):
        out[n, each.part // N_JOINTS, each.part % N_JOINTS] = each.strength * each.since(clock[n])
    return out


def winch_slip(several: Several, clock: Array) -> Array:
    """Angles by which winches have turned on their horns at running times (R,) [s], (R, 9) [rad]."""
    out = np.zeros((len(several), N_JOINTS))
    for n, each in of_kind(several, "slipped_winch"):
        out[n, each.part - 1] = each.strength * each.since(clock[n])
    return out


def gear_play(several: Several) -> Array:
    """Play of single motors' gears beside that of all [rad], (R, 9)."""
    out = np.zeros((len(several), N_JOINTS))
    for n, each in of_kind(several, "loose_gear"):
        out[n, each.part - 1] = each.strength
    return out


def gear_friction(several: Several, angle: Array) -> Array:
    """More dry friction of motors at their angles (R, 10) [N m], (R, 10)."""
    out = np.zeros((len(several), N_MOTORS))
    for n, each in of_kind(several, "rubbing_cable"):
        at = each.part - 1
        out[n, at] = each.strength * each.inside(angle[n, at])
    return out


def stop_torque(several: Several, q: Array) -> Array:
    """Torque of bumpers at joint angles (R, 9) [N m], (R, 9)."""
    out = np.zeros_like(q)
    for n, each in of_kind(several, "soft_stop"):
        at = each.part - 1
        out[n, at] = -each.strength * max(q[n, at] - each.begin, 0.0)
    return out


def relaxing_torque(several: Several, q: Array, rest: Array) -> Array:
    """Torque of springs that relax at joint angles (R, 9) [N m], (R, 9), with those at which they rest."""
    out = np.zeros_like(q)
    for n, each in of_kind(several, "relaxing_joint"):
        at = each.part - 1
        out[n, at] = -each.strength * (q[n, at] - rest[n, at])
    return out


def relax(several: Several, q: Array, rest: Array, h: float) -> None:
    """Let the angles at which springs rest (R, 9) follow those of their joints for h [s]."""
    for n, each in of_kind(several, "relaxing_joint"):
        at = each.part - 1
        rest[n, at] += (q[n, at] - rest[n, at]) * -np.expm1(-h / each.time_constant)


def camera_delay(several: Several, clock: Array) -> Array:
    """Delays of the cameras at running times (R,) [s], (R,) [s]."""
    out = np.zeros(len(several))
    for n, each in of_kind(several, "drifting_clock"):
        out[n] = each.strength * clock[n]
    return out


def swinging(each: Accident, clock: float) -> Array:
    """A push that swings by the clock [N], (3,)."""
    return each.vector * np.sin(2 * np.pi * each.rate * clock + each.phase)


def cord(each: Accident, at: Array) -> Array:
    """The pull of a cord on a link whose centre of mass is somewhere [m] [N], (3,)."""
    end = np.array([_MIDDLE, 0.0, 0.0]) + np.array(REACH) * each.direction
    reach = end - at
    length = float(np.linalg.norm(reach))
    return each.strength * max(length - CORD, 0.0) * reach / max(length, 1e-9)


def encoder(several: Several, angle: Array) -> Array:
    """What encoders show of angles (R, 10) [rad]."""
    out = angle.copy()
    for n, each in of_kind(several, "encoder_wave"):
        at = each.part - 1
        out[n, at] += each.strength * np.sin(each.rate * angle[n, at] + each.phase)
    return out


def loads(several: Several, load: Array, clock: Array) -> Array:
    """What load sensors show of loads (R, 10) at running times (R,) [s]."""
    out = load.copy()
    for n, each in of_kind(several, "dying_load"):
        out[n, each.part - 1] *= 1 - each.strength * min(clock[n] / max(each.instant, 1e-9), 1.0)
    for n, each in of_kind(several, "fading_load"):
        out[n, each.part - 1] *= 1 - each.strength
    return out


def shifts(several: Several, clock: Array, marker: Array, origin: Array, rotation: Array) -> Array:
    """Displacements with which cameras see markers (R, 9, 3) [m], (R, 9, 3) [m], with the links' origins
    (R, 9, 3) and rotations (R, 9, 3, 3).
    """
    out = np.zeros((len(several), N_JOINTS, 3))
    for n, each in of_kind(several, "turned_link"):
        at = each.part - 1
        about = rotation[n, at] @ (each.since(clock[n]) * each.vector)
        reach = marker[n, at:] - origin[n, at]
        out[n, at:] = Rotation.from_rotvec(about).apply(reach) - reach
    for n, each in of_kind(several, "turned_cameras"):
        turn = Rotation.from_rotvec(each.since(clock[n]) * each.vector)
        out[n] = turn.apply(marker[n]) - marker[n]
    for n, each in of_kind(several, "knocked_marker"):
        at = each.part - 1
        out[n, at] = each.since(clock[n]) * (rotation[n, at] @ each.vector)
    for n, each in of_kind(several, "moved_cameras"):
        out[n] += each.since(clock[n]) * each.vector
    return out
