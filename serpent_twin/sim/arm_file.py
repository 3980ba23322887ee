"""Read the arm that a file describes: a twin.json, or a model in MJCF."""

from dataclasses import dataclass
from pathlib import Path

import mujoco

from serpent_twin import stored
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arm.mjcf import STRANDS
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.command_line.options import options_of
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.runs.provenance import model_hash
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import TwinModel

_MOTORS = [f"motor{j}" for j in range(1, N_MOTORS + 1)]
_LINKS = range(1, N_JOINTS + 1)
_JOINTS = [*_MOTORS, *(f"joint{i}" for i in _LINKS), "jaw"]
_IN_ORDER = {  # names in the order in which the twin addresses them
    mujoco.mjtObj.mjOBJ_ACTUATOR: _MOTORS,
    mujoco.mjtObj.mjOBJ_TENDON: list(STRANDS),
    mujoco.mjtObj.mjOBJ_SENSOR: [
        *(f"{motor}_{what}" for what in ("position", "velocity", "torque") for motor in _MOTORS),
        *(f"marker{i}" for i in _LINKS),
    ],
}
_BESIDE_MJCF = ("servo_lag", "controller_gain", "marker_noise", "load_noise")
"""Parameters that no MJCF holds, so that they may be given beside one"""
_ADVICE = "Give a twin.json or a model in MJCF."
_MOST = 100_000_000  # bytes of an MJCF file, without what it includes
_HINGE = mujoco.mjtJoint.mjJNT_HINGE


@dataclass(frozen=True)
class ArmFile:
    """An arm to simulate, whole."""

    design: TwinModel
    """What twin.json holds; of an arm in MJCF, its noise and its controller"""
    path: Path | None = None
    """Where it was read, if it was"""
    model: mujoco.MjModel | None = None
    """What MJCF holds"""

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the arm's physics, also of what an MJCF file includes."""
        return model_hash(self.model) if self.model else self.design.fingerprint()

    @property
    def note(self) -> str:
        """A note for the reader; empty for twin.json."""
        if self.model is None:
            return ""
        return f"{self.path} is MJCF, which lacks the effects that only twin.json can hold."

    def twin(self, prior_runtime: float = 0.0) -> Twin:
        """A twin of the arm, after `prior_runtime` in earlier sessions [s]."""
        return Twin(self.design, model=self.model, prior_runtime=prior_runtime)


def read(path: Path | None, parameters: Parameters = NOMINAL, flag: str = "--twin") -> ArmFile:
    """Read twin.json or MJCF; raises `SerpentError` naming what the file lacks.

    `parameters` are those beside the file on the command line, where `flag` named it. Without a file
    they make the arm; MJCF takes its noise, its servos' lag and its controller from them and allows no
    others; twin.json allows none.
    """
    if path is None:
        return ArmFile(TwinModel(parameters))
    beside = () if path.suffix == ".json" else _BESIDE_MJCF
    given = [each.flag for each in options_of(parameters) if each.name not in beside and each.given]
    if given:
        raise SerpentError(
            f"{flag} {path} holds the arm's parameters already; leave out {', '.join(given)}."
        )
    if path.suffix == ".json":
        return ArmFile(twin_model.read(path), path)
    return ArmFile(TwinModel(parameters), path, _model(path))


def _model(path: Path) -> mujoco.MjModel:
    stored.require_file(path, _MOST, _ADVICE)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        why = " ".join(str(error).split()).rstrip(".")
        raise SerpentError(
            f"{path} is no model that MuJoCo can load: {why.rstrip('.')}. {_ADVICE}"
        ) from error
    for kind, names in _IN_ORDER.items():
        found = [mujoco.mj_id2name(model, kind, n) for n in range(len(names))]
        _refuse(path, kind, names, [a for a, b in zip(names, found, strict=True) if a != b])
    lost = [n for n in _JOINTS if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, n) < 0]
    _refuse(path, mujoco.mjtObj.mjOBJ_JOINT, _JOINTS, lost)
    hinges = all(model.joint(name).type[0] == _HINGE for name in _JOINTS)
    if not hinges or model.ntendon != len(STRANDS) or model.nu < 2 * N_MOTORS:
        raise SerpentError(
            f"{path} is no model of the arm: it has {model.ntendon} tendons and {counted(model.nu, 'input')} "
            f"instead of {2 * N_MOTORS} each, or joints that are no hinges; its motors need a goal "
            "position and a velocity each."
        )
    return model


def _refuse(path: Path, kind: mujoco.mjtObj, names: list[str], wrong: list[str]) -> None:
    if wrong:
        what = kind.name.removeprefix("mjOBJ_").lower()
        raise SerpentError(
            f"{path} is no model of the arm: {what}s must be {names[0]}, {names[1]}, … in the "
            f"order that python -m serpent_twin.mjcf writes; missing or elsewhere: "
            f"{', '.join(wrong)}."
        )
