"""Is an MJCF file a model of this arm?"""

from pathlib import Path

import mujoco

from serpent_twin.arm import N_JOINTS, N_MOTORS
from serpent_twin.errors import SerpentError
from serpent_twin.mjcf import STRANDS
from serpent_twin.twin import Twin

_MOTORS = [f"motor{j}" for j in range(1, N_MOTORS + 1)]
_LINKS = range(1, N_JOINTS + 1)
_WANTED = {  # names in the order in which the twin addresses them
    mujoco.mjtObj.mjOBJ_JOINT: [*_MOTORS, *(f"joint{i}" for i in _LINKS), "jaw"],
    mujoco.mjtObj.mjOBJ_ACTUATOR: _MOTORS,
    mujoco.mjtObj.mjOBJ_TENDON: list(STRANDS),
    mujoco.mjtObj.mjOBJ_SENSOR: [
        *(f"{motor}_{what}" for what in ("position", "velocity", "torque") for motor in _MOTORS),
        *(f"marker{i}" for i in _LINKS),
    ],
}


def load_twin(path: Path) -> Twin:
    """A twin of the arm in an MJCF file; raises `SerpentError` naming what the file lacks."""
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise SerpentError(f"{path} is no model that MuJoCo can load: {error}") from error
    for kind, names in _WANTED.items():
        found = [mujoco.mj_id2name(model, kind, n) for n in range(len(names))]
        wrong = [name for name, other in zip(names, found, strict=True) if name != other]
        if wrong:
            what = kind.name.removeprefix("mjOBJ_").lower()
            raise SerpentError(
                f"{path} is no model of the arm: {what}s must be {names[0]}, {names[1]}, … in the "
                f"order that python -m serpent_twin.mjcf writes; missing or elsewhere: "
                f"{', '.join(wrong)}."
            )
    if (model.nq, model.nu) != (len(_WANTED[mujoco.mjtObj.mjOBJ_JOINT]), 2 * N_MOTORS):
        raise SerpentError(
            f"{path} is no model of the arm: it has {model.nq} coordinates and {model.nu} inputs "
            f"instead of {2 * N_MOTORS} each; its motors need a goal position and a velocity each."
        )
    return Twin(model)
