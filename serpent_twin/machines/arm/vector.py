"""Define the parameter vector of the arm's calibration: coordinates, priors and start."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arm.kinematic_calibration import PRIORS, Kinematics
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.arrays import Array
from serpent_twin.machines.arm.cable_law import CableLaw
from serpent_twin.machines.arm.catalogue import CATALOGUE
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.machine import Declared, ParameterVector, by_coordinate, effects_at
from serpent_twin.sim.reading_age import without_age
from serpent_twin.sim.twin_model import TwinModel

_TRUST = 2.0  # prior widths are so many standard errors of the cable laws, which ignore mismatch
_STIFFNESS, _SLACK, _WINCH = 0.02, 0.02, 0.1  # [log], [mm], [%] at least
_ALIKE = 0.15
"""Share by which strands of one arm differ, or as much as the cable laws show: logs of fast motion hardly
determine the slack of the last cables, which then take up whatever the twin lacks
"""
_GEAR = 0.3  # [log] gears of one arm differ, or as much as the largest first guess is above a gear's own
_LEAST_GEAR = 0.3
"""Of the gears' median friction, with which a gear begins at least: play hides friction from its cable law,
and from none at all no fit would come back
"""
_MARKER = 0.5  # [mm] at least: a camera or marker that moved in a log takes all places along
_APART = 0.3  # [log] hinges differ
_JAW = 1.5  # [log]: a jaw may turn as lightly as none
_MASS = 0.03  # [log] printed links differ
_FARTHEST: Mapping[str, float] = {"length": 3.0, "mass": 2.0, "axis": 3.0}
"""Standard deviations of a part as built at which a fit holds it: links that went further stood
for a payload
"""
_TRANSITION = 0.02  # [rad/s]
_UNKNOWN_STIFFNESS, _UNKNOWN_SLACK, _UNKNOWN_WINCH = 0.25, 0.3, 0.5  # of a cable not in any log


def _of_joints(what: str) -> tuple[str, ...]:
    """What all hinges have in common, and how each differs from it."""
    return (f"{what} of all joints", *(f"{what} of joint {i}" for i in range(1, N_JOINTS + 1)))


_MOTORS, _JOINTS = range(1, N_MOTORS + 1), range(1, N_JOINTS + 1)
NAMES: Mapping[str, tuple[str, ...]] = {
    "stiffness": tuple(f"stiffness of {name}" for name in mjcf.STRANDS),
    "slack": tuple(f"slack of {name}" for name in mjcf.STRANDS),
    "winch": tuple(f"winch of motor {j}" for j in _MOTORS),
    "friction": _of_joints("friction"),
    "transition": _of_joints("transition velocity"),
    "damping": _of_joints("damping"),
    "jaw": ("friction of the jaw",),
    "gear": tuple(f"gear friction of motor {j}" for j in _MOTORS),
    "marker": tuple(f"place of marker {i} along {axis}" for i in _JOINTS for axis in "xyz"),
    "length": tuple(f"length of link {i}" for i in range(1, N_JOINTS)),
    "mass": tuple(f"mass of link {i}" for i in _JOINTS),
    "axis": tuple(f"axis of joint {i} {way}" for i in _JOINTS for way in ("along", "across")),
    "camera_shift": tuple(f"shift of the cameras along {axis}" for axis in "xyz"),
    "camera_turn": tuple(f"turn of the cameras about {axis}" for axis in "xyz"),
}
"""The coordinates of each kind of parameter; the last link's length moves nothing that cameras see"""
_STILL = ("gear", "marker", "camera_shift", "camera_turn")  # kinds that move nothing


@dataclass(frozen=True)
class Vector:
    """The fit's coordinates, and the twin model of any parameter vector."""

    start: TwinModel
    """The twin model at all coordinates zero"""
    declared: tuple[Declared, ...]
    """Those of `NAMES`, in its order"""

    @property
    def names(self) -> Mapping[str, tuple[str, ...]]:
        """The coordinates of each kind of parameter; of hinges, the common part first."""
        return NAMES

    @property
    def moving(self) -> tuple[str, ...]:
        """The coordinates that move the arm: those of cables and hinges."""
        return tuple(n for kind, names in NAMES.items() if kind not in _STILL for n in names)

    def design(self, point: ParameterVector) -> TwinModel:
        """The twin model of a parameter vector."""
        value = by_coordinate(self.declared, point.declared)
        x = {kind: np.array([value[name] for name in names]) for kind, names in NAMES.items()}
        t = self.start.tolerances
        tolerances = replace(
            t,
            strand_stiffness=_plus(t.strand_stiffness, x["stiffness"]),
            strand_slack=_plus(t.strand_slack, 1e-3 * x["slack"]),
            winch_radius=_plus(t.winch_radius, 1e-2 * x["winch"]),
            joint_friction=_plus(t.joint_friction, x["friction"][0] + x["friction"][1:]),
            transition_velocity=_plus(
                t.transition_velocity, x["transition"][0] + x["transition"][1:]
            ),
            joint_damping=_plus(t.joint_damping, x["damping"][0] + x["damping"][1:]),
            jaw_friction=_plus(t.jaw_friction, x["jaw"]),
            gear_friction=_plus(t.gear_friction, x["gear"]),
            marker=_plus(t.marker, 1e-3 * x["marker"]),
            link_length=_plus(t.link_length, 1e-2 * np.r_[x["length"], 0.0]),
            link_mass=_plus(t.link_mass, x["mass"]),
            axis_tilt=_plus(t.axis_tilt, 1e-3 * x["axis"]),
            camera_pose=_plus(t.camera_pose, 1e-3 * np.r_[x["camera_shift"], x["camera_turn"]]),
        )
        effects = effects_at(point)
        known = self.start.parameters
        parameters = replace(known, servo_lag=without_age(known.servo_lag, effects))
        return replace(self.start, parameters=parameters, tolerances=tolerances, effects=effects)


def _plus(nominal: Sequence[float], change: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in np.asarray(nominal) + change)


def candidates() -> dict[str, Candidate]:
    """Every effect of the arm's catalogue."""
    return {name: candidate(name) for name in CATALOGUE}


def vector(
    laws: Sequence[CableLaw | None],
    built: Kinematics,
    friction: float,
    damping: float,
) -> Vector:
    """Coordinates around first guesses: cable laws (10), the built geometry, and the hinges' friction [N m]
    and damping [N m s/rad].
    """
    known = [law for law in laws if law]
    stiffness = (
        float(np.median([law.stiffness for law in known])) if known else NOMINAL.strand_stiffness
    )
    slack = float(np.median([law.slack for law in known])) if known else NOMINAL.strand_slack
    slack = max(slack, 0.0)  # motors that obey late can make it seem less
    gears = _gears(laws)
    gear = float(np.median(gears))
    parameters = replace(
        NOMINAL,
        strand_stiffness=stiffness,
        strand_slack=slack,
        gear_friction=gear,
        joint_friction=friction,
        transition_velocity=_TRANSITION,
        joint_damping=damping,
    )
    tolerances = replace(
        built.deviations,
        strand_stiffness=tuple(
            float(np.log(law.stiffness[side] / stiffness)) if law else 0.0
            for law in laws
            for side in (0, 1)
        ),
        strand_slack=tuple(
            float(law.slack[side] - slack) if law else 0.0 for law in laws for side in (0, 1)
        ),
        jaw_held=(0.0 if laws[-1] is None else 1.0,),
        winch_radius=tuple(law.winch if law else 0.0 for law in laws),
        gear_friction=tuple(map(float, np.log(gears / gear))),
    )
    return Vector(
        TwinModel(parameters, tolerances), _declare(laws, gears, 1e3 * built.marker_error)
    )


def _gears(laws: Sequence[CableLaw | None]) -> Array:
    """First guesses of the gears' friction, of a motor that never turns the others' median [N m], (10,)."""
    known = [law.gear_friction for law in laws if law]
    middle = max(float(np.median(known)) if known else NOMINAL.gear_friction, 1e-4)
    return np.array(
        [max(law.gear_friction, _LEAST_GEAR * middle) if law else middle for law in laws]
    )


def _apart(values: Array, least: float) -> float:
    """How much most of some values differ, as a standard deviation, if by more than the least."""
    return max(least, 1.4826 * float(np.median(np.abs(values - np.median(values)))))


def _declare(
    laws: Sequence[CableLaw | None], gears: Array, offset_error: Array
) -> tuple[Declared, ...]:
    rows = []
    known = [law for law in laws if law]
    differ = _apart(np.log([law.stiffness for law in known]), _ALIKE) if known else np.inf
    for n, name in enumerate(NAMES["stiffness"]):
        law = laws[n // 2]
        width = max(_STIFFNESS, _TRUST * law.stiffness_error[n % 2]) if law else _UNKNOWN_STIFFNESS
        rows.append(Declared(name, "log N/m", min(width, differ), 0.03))
    slack = 1e3 * np.array([law.slack for law in known])
    differ = (
        _apart(slack, max(_SLACK, _ALIKE * float(np.median(np.abs(slack))))) if known else np.inf
    )
    for n, name in enumerate(NAMES["slack"]):
        law = laws[n // 2]
        width = max(_SLACK, _TRUST * 1e3 * law.slack_error[n % 2]) if law else _UNKNOWN_SLACK
        rows.append(Declared(name, "mm", min(width, differ), 0.02))
    for name, law in zip(NAMES["winch"], laws, strict=True):
        width = max(_WINCH, _TRUST * 1e2 * law.winch_error) if law else _UNKNOWN_WINCH
        rows.append(Declared(name, "% of radius", min(width, 1.0), 0.2))
    for kind, unit, together, step in (
        ("friction", "log N m", 1.0, 0.1),
        ("transition", "log rad/s", 1.0, 0.3),
        ("damping", "log N m s/rad", 1.5, 0.1),
    ):
        for k, name in enumerate(NAMES[kind]):
            rows.append(Declared(name, unit, _APART if k else together, step))
    rows += [Declared(name, "log N m", _JAW, 0.1) for name in NAMES["jaw"]]
    for name, least in zip(NAMES["gear"], gears, strict=True):
        width = max(_GEAR, float(np.log(gears.max() / least)))
        rows.append(Declared(name, "log N m", width, 0.1))
    widths = np.maximum(_MARKER, _TRUST * offset_error.ravel())
    for name, width in zip(NAMES["marker"], widths, strict=True):
        rows.append(Declared(name, "mm", width, 0.1))
    for kind, unit, width, step in (
        ("length", "% of length", 1e2 * PRIORS["link_length"][0], 0.2),
        ("mass", "log kg", _MASS, 0.02),
        ("axis", "mrad", 1e3 * PRIORS["axis_tilt"][0], 1.0),
        ("camera_shift", "mm", 1e3 * PRIORS["camera_pose"][0], 0.1),
        ("camera_turn", "mrad", 1e3 * PRIORS["camera_pose"][-1], 0.1),
    ):
        farthest = _FARTHEST.get(kind, np.inf) * width
        rows += [Declared(name, unit, width, step, farthest) for name in NAMES[kind]]
    return tuple(rows)
