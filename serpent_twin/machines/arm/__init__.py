"""Make the cable-driven serpentine arm a machine that can be traced."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS, joint_from_motor
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arm.kinematic_calibration import calibrate
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.arm.cable_law import cable_laws
from serpent_twin.machines.arm.machine import ArmMachine
from serpent_twin.machines.arm.recorder import recorded_by
from serpent_twin.machines.arm.vector import candidates, vector
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.sessions import Session, read_folder, read_session, refuse_damaged
from serpent_twin.sim.prescribed_motion import STANDING
from serpent_twin.tables.segments import Segments

_FRICTIONS = (0.0015, 0.004, 0.01)  # [N m] of each hinge, tried with
_DAMPINGS = (0.001, 0.004, 0.015)  # [N m s/rad], and with
_JAWS = (0.0, -3.0)  # [log] of a jaw's frictions over a hinge's: as much, or hardly any
_MOVES = 0.02  # share of rows in which a motor must turn for its cable and gear to be identified
_ROWS = 600  # rows used to calibrate the kinematics
_MARKER_NOISE, _LOAD_NOISE = 1e-3, 5e-3  # [m], [fraction of stall] that a first guess leaves
_TRIED = 4  # segments to find the hinges' friction


@dataclass(frozen=True)
class ArmRig:
    """The arm of `serpent_twin.arm`, driven by its motors' angles, measured by cameras and motor loads."""

    name: str = "arm"

    def read(self, source: Path) -> list[Session]:
        """The sessions of a folder, or that of one file, checked."""
        sessions = [read_session(source)] if source.is_file() else read_folder(source)
        refuse_damaged(sessions)
        for session in sessions:
            if not np.isfinite(session.marker).any():
                raise SerpentError(
                    f"{session.path or session.name} has no markers, which show where the arm was. "
                    "Add them: python -m serpent_twin.mocap merge --help."
                )
        return sessions

    def open(self, training: Sequence[Session]) -> Case[Segments]:
        """First guesses: built geometry and cable laws from poses and loads alone, then the hinges'
        friction and damping by trying nine of each.
        """
        refuse_damaged(list(training))
        marker, motor, velocity, load = (
            np.concatenate([getattr(session, name) for session in training])
            for name in ("marker", "motor_position", "motor_velocity", "motor_load")
        )
        start = joint_from_motor(motor[:, :N_JOINTS])
        few = slice(None, None, max(1, len(marker) // _ROWS))
        found = calibrate(marker[few], start[few])
        joint = joints_from_markers(marker, start, found.deviations.built(ARM))
        laws = cable_laws(joint, motor, velocity, load)
        about = vector(laws, found, _FRICTIONS[1], _DAMPINGS[1])
        parameters = recorded_by(about.start.parameters, training, found.rms)
        about = replace(about, start=replace(about.start, parameters=parameters))
        noise = np.r_[np.full(3 * N_JOINTS, _MARKER_NOISE), np.full(N_MOTORS, _LOAD_NOISE)]
        known = candidates()
        arm = ArmMachine(about, known)
        case = Case(arm, noise, _unseen(velocity, known))
        return _with_friction(case, arm, training)


def moving(velocity: Array) -> Array:
    """Which motors turn often enough for their cables and gears to be identified, of bool, (10,)."""
    return (np.abs(velocity) > 2 * STANDING).mean(axis=0) > _MOVES


def _unseen(velocity: Array, known: Mapping[str, Candidate]) -> dict[str, str]:
    """Candidates that the logs cannot show: all if no motor turns, else none."""
    if moving(velocity).any():
        return {}
    why = "no motor moves in these logs, and a pose alone cannot distinguish an effect from a parameter"
    return dict.fromkeys(known, why)


def _with_friction(
    case: Case[Segments], arm: ArmMachine, training: Sequence[Session]
) -> Case[Segments]:
    """The case that starts from the best frictions of hinges and jaw that were tried on a few segments."""
    pieces = case.pieces(training)
    some = case.take(pieces, range(0, len(pieces), max(1, len(pieces) // _TRIED)))
    tried = list(product(_FRICTIONS, _DAMPINGS, _JAWS))
    start, names = arm.vector.start, [each.name for each in arm.declared]
    points = []
    for friction, damping, jaw in tried:
        x = np.zeros(len(case.declared))
        x[names.index("friction of the jaw")] = jaw
        x[names.index("friction of all joints")] = np.log(
            friction / start.parameters.joint_friction
        )
        x[names.index("damping of all joints")] = np.log(damping / start.parameters.joint_damping)
        points.append(ParameterVector(x))
    cost = np.nansum(case.residual(points, some) ** 2, axis=(1, 2))
    friction, damping, jaw = tried[int(np.argmin(np.where(cost > 0, cost, np.inf)))]
    parameters = replace(start.parameters, joint_friction=friction, joint_damping=damping)
    tolerances = replace(start.tolerances, jaw_friction=(jaw,))
    start = replace(start, parameters=parameters, tolerances=tolerances)
    moved = replace(arm.vector, start=start)
    return replace(case, machine=replace(arm, vector=moved))


MACHINE = ArmRig()
