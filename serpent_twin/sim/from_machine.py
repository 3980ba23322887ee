"""Make the arm's twin model of the twin.json that a trace of model/machine.toml writes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Annotated, Any

import mujoco
import numpy as np
import scipy
from msgspec import field

from serpent_twin import effects, stored
from serpent_twin.arm import mjcf
from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.geometry import ARM, N_JOINTS
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.arrays import Array
from serpent_twin.effects import Several
from serpent_twin.engine.friction_softness import STICKS, USUAL, transition_of
from serpent_twin.sim.reading_age import without_age

KIND = "serpent"
"""Name of the arm's machine.toml"""
_HOLDS = 0.1
"""Friction [N m] with which the jaw is held: no cable pulls as much at its pulley of 4 mm"""
_Value = Annotated[float, stored.within(-1e6, 1e6)]
_LINKS = tuple(f"link{i}" for i in range(1, N_JOINTS + 1))
_MARKERS = tuple(f"marker{i}" for i in range(1, N_JOINTS + 1))


class Origin(stored.OpenForm, frozen=True):
    """The logs that a twin was fitted to, as `trace` states them."""

    input_sha256: dict[str, str] = field(default_factory=dict)
    """SHA-256 of each session's file, by the session's name"""
    held_out: Annotated[int, stored.within(0, 1_000_000)] | tuple[str, ...] = 0
    """How many of the last sessions judged, or which ones"""


class _Coordinate(stored.OpenForm, frozen=True):
    value: _Value


class MachineFile(stored.OpenForm, frozen=True):
    """What twin.json of the arm's machine.toml holds that its twin model has, too."""

    declared: dict[str, _Coordinate]
    effects: tuple[effects.Stored, ...]
    first: dict[str, tuple[_Value, ...]]
    """`shift` of the cameras' frame, and the `pivot` about which it is turned [m]"""
    noise: dict[str, _Value] = field(default_factory=dict)
    """What the twin leaves of each column [m, N m]"""
    lag: _Value = 0.0
    """Lag of the servos [s]"""
    arm: str = ""
    """Name of the arm whose logs made it"""
    provenance: Origin = Origin()

    def __post_init__(self) -> None:
        effects.require_distinct(self.effects)

    def total(self, number: str, things: Sequence[str]) -> Array:
        """The sum of all coordinates of a number of each thing; 0 of what none is of."""
        parts = [name.split(" of ", 1) for name in self.declared]
        said = [
            (each[1], one.value)
            for each, one in zip(parts, self.declared.values(), strict=True)
            if each[0] == number
        ]
        return np.array(
            [sum(value for of, value in said if fnmatchcase(thing, of)) for thing in things]
        )

    @property
    def several(self) -> Several:
        """The effects."""
        return tuple(map(effects.restored, self.effects))

    @property
    def parameters(self) -> Parameters:
        """Parameters of all parts of a kind."""
        marker = self._left("marker*", NOMINAL.marker_noise)
        load = self._left("motor*_load", ARM.servo.stall_torque * NOMINAL.load_noise)
        return replace(
            NOMINAL,
            servo_lag=without_age(self.lag, self.several),
            marker_noise=marker,
            load_noise=load / ARM.servo.stall_torque,
        )

    def _left(self, columns: str, unknown: float) -> float:
        """The median of what the twin leaves of columns of some name; if that is not stated, as given."""
        left = [value for name, value in self.noise.items() if fnmatchcase(name, columns)]
        return float(np.median(left)) if left else unknown

    @property
    def tolerances(self) -> Deviations:
        """Deviations of single parts, but for the velocities below which hinges creep."""
        of = self.total
        strands, motors, joints = mjcf.STRANDS, mjcf.MOTORS, mjcf.JOINTS
        places = np.stack([of(f"site {axis}", _MARKERS) for axis in "xyz"], axis=1)
        across = np.where(
            np.arange(N_JOINTS) % 2, of("joint axis z", joints), -of("joint axis y", joints)
        )
        leans = np.stack([of("joint axis x", joints), across], axis=1)
        jaw = of("joint friction", ("jaw",))
        held = NOMINAL.joint_friction * np.exp(jaw[0]) > _HOLDS
        longer = np.append(np.expm1(of("body x", _LINKS[1:])), 0.0)
        return Deviations(
            strand_stiffness=_floats(of("tendon stiffness", strands)),
            strand_slack=_floats(1e-3 * of("tendon slack", strands)),
            winch_radius=_floats(np.expm1(of("moment arm", motors))),
            joint_friction=_floats(of("joint friction", joints)),
            jaw_friction=(0.0,) if held else _floats(jaw),
            jaw_held=(float(held),),
            joint_damping=_floats(of("joint damping", joints)),
            gear_friction=_floats(of("joint friction", motors)),
            marker=_floats(1e-3 * places),
            link_length=_floats(longer),
            link_mass=_floats(of("mass", _LINKS)),
            axis_tilt=_floats(1e-3 * leans),
            camera_pose=_floats(self._cameras()),
        )

    def _cameras(self) -> Array:
        """Shift [m] and turn [rad] of the cameras' frame about the base, (6,)."""
        turned, along = (
            np.array([self._own(f"cameras {how} {axis}") for axis in "xyz"])
            for how in ("turned about", "along")
        )
        rotation = scipy.spatial.transform.Rotation
        turn, pivot = rotation.from_rotvec(np.radians(turned)), np.array(self.first["pivot"])
        shift = pivot + np.array(self.first["shift"]) + 1e-3 * along - turn.apply(pivot)
        return np.r_[shift, turn.as_rotvec()]

    def _own(self, name: str) -> float:
        return self.declared[name].value if name in self.declared else 0.0

    def creep(self, model: mujoco.MjModel) -> Array:
        """Velocities below which the hinges of a model creep that has all else of this twin [rad/s], (9,);
        zeros where they stick.
        """
        more = self.total("friction near rest", mjcf.JOINTS)
        dof = [int(model.joint(name).dofadr[0]) for name in mjcf.JOINTS]
        quick = (1 - STICKS) * USUAL * np.exp(-more)
        velocity = transition_of(model.dof_frictionloss[dof], model.dof_invweight0[dof], quick)
        return np.where(more != 0, velocity, 0.0)


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(np.ravel(values).tolist())


def machine_file(of: Mapping[str, Any], where: str, advice: str) -> MachineFile:
    """What such a twin.json holds; raises a `SerpentError` that names the key at fault."""
    return stored.take(dict(of), MachineFile, where, advice)
