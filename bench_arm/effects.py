"""Define the effects that a bench arm may have and its log does not state."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.errors import SerpentError

from . import accidents
from .accidents import ACCIDENTS, Accident


@dataclass(frozen=True)
class Effects:
    """Laws by strength; zero strength is absence, whatever the other values are."""

    payload: float = 0.0
    """Point mass on a link's long axis [kg]."""
    payload_link: int = 9
    """Which link, 1 … 9."""
    payload_at: float = 0.090
    """Behind that link's joint [m]; in the gripper if nothing else is said."""
    base_tilt: float = 0.0
    """Angle by which gravity leans away from the base's x [rad]."""
    tilt_direction: float = 0.0
    """Direction ψ of the tilt [rad]: gravity's vector turns by tilt cos ψ about base y, then by
    tilt sin ψ about base z."""
    mocap_latency: float = 0.0
    """Age of the marker positions when the motors are read [s], at most one control period."""
    motor_latency: float = 0.0
    """Age of what the motors report (angle, speed, load) when they are read [s], at most one control
    period; the controller has nothing newer."""
    gear_backlash: float = 0.0
    """Full gap between each measured motor angle m and its winch w [rad]: the winch keeps still while
    |m − w| ≤ gap / 2 (play operator); the cable's torque reaches the motor all the same, as the play
    lies beside what holds it."""
    cable_friction: float = 0.0
    """Coefficient c of the pulleys' dry friction: joint i resists its motion by c Σ r_j T_j over the
    cables j ≥ i that wrap it, T_j the sum of the strands' tensions that rub [1]."""
    cable_friction_wrap: float = 0.0
    """Coefficient μ of pulley friction by Amontons' law on a strand that bends by |q_i|, so presses on the
    groove with T dφ: joint i resists by Σ r_j T_j (exp(μ |q_i|) − 1) [1]."""
    gear_friction: float = 0.0
    """Gearbox loss per load torque |τ| [1], seen in the load reading alone, against the motion."""
    friction_warming: float = 0.0
    """F, by which the dry friction of cold gears is greater than that of warm ones, in the mean of the gears
    [N m]: a gear's is f (1 + F/f̄ exp(−t/τ)) at a time t in a session, f that of the warm gear and f̄ the mean
    of all. Gears cool down between sessions."""
    warming_time: float = 40.0
    """τ of friction_warming [s]."""
    cable_creep: float = 0.0
    """Share f of a strand's elastic stretch that it gains by creeping: de/dt = (f T/k − e)/τ [1]."""
    creep_time: float = 60.0
    """τ of cable_creep [s]."""
    cable_stiffening: float = 0.0
    """1/x₀ of T = k x (1 + x/x₀) [1/m]."""
    cable: int = 0
    """Cable whose strands creep, stiffen, wear and rub on pulleys, 1 … 9; 0 for all cables."""
    side: int = 0
    """Which of its strands: 1 for the + strand, −1 for the − strand, 0 for both."""
    clamp_slip: float = 0.0
    """Rate at which a strand lengthens permanently per tension beyond the threshold [m/(N s)]. Clamps are
    tightened again before every session."""
    clamp_threshold: float = 5.0
    """Tension that the clamp holds [N]."""
    clamp_strand: int = 0
    """Which strand's clamp: 0 … 8 for + strands of cables 1 … 9, 9 … 17 for − strands."""
    link_flex: float = 0.0
    """Compliance of a hinge at each link's middle, about y and about z [rad/(N m)]. The cables run
    through that hinge; the link's marker sits between its two halves."""
    link_twist: float = 0.0
    """Compliance of a hinge at each link's middle about the link's long axis x [rad/(N m)]."""
    joint_elasticity: float = 0.0
    """Spring beside each hinge, towards straight [N m/rad]."""
    stiffness_drift: float = 0.0
    """Share of a strand's stiffness lost per hour of running [1/h], down to a tenth. Sessions run end
    to end."""
    outside_force: float = 0.0
    """A constant pull on one link's centre of mass [N] while a joint is beyond an angle."""
    force_direction: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """The pull's direction in the base frame."""
    force_link: int = 9
    """Which link is pulled, 1 … 9."""
    force_joint: int = 4
    """Which joint's angle decides, 1 … 9."""
    force_threshold: float = 0.2
    """Above which angle the pull acts [rad]."""
    sticking_joint: float = 0.0
    """Increase of one joint's dry friction inside a window of its angle, as a multiple of it [1]."""
    stick_joint: int = 4
    """Which joint, 1 … 9."""
    stick_window: tuple[float, float] = (0.10, 0.25)
    """Lower and upper end of the window in which a joint sticks [rad]."""
    load_ripple: float = 0.0
    """Amplitude a of a sin(n m + φ) in one motor's load reading, m its angle [fraction of stall]."""
    ripple_motor: int = 3
    """Which motor, 1 … 10."""
    ripple_periods: float = 2.0
    """n, waves per motor turn [1]."""
    ripple_phase: float = 0.0
    """φ [rad]."""
    accidents: tuple[Accident, ...] = ()
    """What happened to single parts"""

    def strength(self, name: str) -> float:
        """The strength of an effect or accident, in its unit; 0 for one that is absent."""
        if name in ACCIDENTS:
            return sum(each.strength for each in self.accidents if each.kind == name)
        return float(getattr(self, name))

    @property
    def flexes(self) -> str:
        """Axes about which links flex: z and y to bend, x to twist."""
        return "zy" * bool(self.link_flex) + "x" * bool(self.link_twist)


NONE = Effects()
TYPICAL: dict[str, float] = {
    "payload": 0.03,
    "base_tilt": 0.08,
    "mocap_latency": 0.04,
    "motor_latency": 0.04,
    "gear_backlash": 0.04,
    "cable_friction": 0.12,
    "cable_friction_wrap": 0.6,
    "gear_friction": 0.3,
    "friction_warming": 0.06,
    "cable_creep": 0.5,
    "cable_stiffening": 5e2,
    "clamp_slip": 2e-5,
    "link_flex": 0.05,
    "link_twist": 0.1,
    "joint_elasticity": 0.1,
    "stiffness_drift": 0.9,
    "outside_force": 0.4,
    "sticking_joint": 6.0,
    "load_ripple": 0.03,
    **{name: strength for name, (strength, _) in ACCIDENTS.items()},
}
"""A strength of each that an arm of this size shows clearly."""
NAMES = tuple(TYPICAL)


_RUNS = 1200.0
"""Running time of four sessions of 5 minutes [s]"""


def inject(
    name: str,
    strength: float,
    rng: np.random.Generator,
    beside: Effects = NONE,
    seconds: float = _RUNS,
) -> Effects:
    """One effect at a strength, in its own unit, beside others; where it sits is drawn, and when it happens
    in an arm that runs for so many seconds in all.

    Raises a `SerpentError` for a name that is none of `NAMES` ("none" adds nothing).
    """
    if name == "none":
        return beside
    if name not in NAMES:
        raise SerpentError(f"There is no effect {name!r}. Choose from: none, {', '.join(NAMES)}.")
    if name in ACCIDENTS:
        happened = accidents.draw(name, strength, rng, seconds)
        return replace(beside, accidents=(*beside.accidents, happened))
    chosen: dict[str, Any] = {name: strength, **_place(name, rng)}
    return replace(beside, **chosen)


def _place(name: str, rng: np.random.Generator) -> dict[str, object]:
    """What an effect has besides its strength."""
    direction = rng.standard_normal(3)
    edge = rng.uniform(0.02, 0.15)
    places: dict[str, dict[str, object]] = {
        "base_tilt": {"tilt_direction": rng.uniform(-np.pi, np.pi)},
        "cable_creep": {"creep_time": rng.uniform(20.0, 120.0)},
        "clamp_slip": {
            "clamp_threshold": rng.uniform(3.0, 8.0),
            "clamp_strand": int(rng.integers(6)),
        },
        "outside_force": {
            "force_direction": tuple((direction / np.linalg.norm(direction)).tolist()),
            "force_link": int(rng.integers(6, N_JOINTS + 1)),
            "force_joint": int(rng.integers(1, N_JOINTS + 1)),
            "force_threshold": rng.uniform(0.05, 0.2),
        },
        "sticking_joint": {
            "stick_joint": int(rng.integers(1, N_JOINTS + 1)),
            "stick_window": (edge, edge + 0.15),
        },
        "load_ripple": {
            "ripple_motor": int(rng.integers(3, N_JOINTS + 1)),
            "ripple_periods": float(rng.integers(1, 7)),
            "ripple_phase": rng.uniform(-np.pi, np.pi),
        },
        # Last, so that seeds give the places that they gave before.
        "friction_warming": {"warming_time": rng.uniform(25.0, 80.0)},
    }
    return places.get(name, {})
