"""Attach the effects of a twin to a MuJoCo simulation."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import mujoco

from serpent_twin.effects import CABLE, Effect, name_of
from serpent_twin.effects.command_delay import CommandDelay
from serpent_twin.errors import SerpentError
from serpent_twin.interchange.attached import Attached
from serpent_twin.interchange.commands import Commands
from serpent_twin.interchange.readings import SensedNow
from serpent_twin.machines.model.drive_table import TABLE, read_drives
from serpent_twin.machines.model.state_effects import acting_on_state, acts_on_state
from serpent_twin.machines.model.twin_file import read_described


def attach(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    twin: str | PathLike[str],
    prior_runtime: float = 0.0,
) -> Attached:
    """Let the effects of a twin.json that its twin.xml cannot express act in a simulation of that twin.xml.

    They act from the state that the simulation has now, in each `mj_step`, until `detach` of what is
    returned. `data.time` is the time since the session began, `prior_runtime` that of earlier sessions [s].
    Raises a `SerpentError` that names what cannot be attached, and why.
    """
    path = Path(twin)
    there = [each for each in read_described(path).several if not each.absent and each.acts()]
    table = read_drives(model)
    if table is None:
        raise SerpentError(
            f"the model is not the twin of {path}: it lacks the table {TABLE!r}, which a trace writes into "
            f"the twin.xml of a machine that a machine.toml describes. Load {path.with_suffix('.xml')}; "
            "trace again if it is older than serpent_twin.attach."
        )
    on_state = acting_on_state(there, model)
    readings = [each for each in there if each.of_readings]
    commanded = _commanded(there, model)
    _require_callbacks(model, [*on_state, *commanded])
    return Attached(
        model,
        data,
        on_state,
        Commands(model, data, commanded, table, prior_runtime),
        SensedNow(model, data, readings, prior_runtime),
        prior_runtime,
    )


def _commanded(there: Sequence[Effect], model: mujoco.MjModel) -> list[Effect]:
    """Effects on commands; none where all are delays, which the model has."""
    several = [e for e in there if e.acts_at < CABLE and not acts_on_state(e, model)]
    return several if any(not isinstance(each, CommandDelay) for each in several) else []


def _require_callbacks(model: mujoco.MjModel, several: Sequence[Effect]) -> None:
    """Refuse a model whose steps do not call back, or call back several times."""
    names = ", ".join(map(name_of, several))
    if several and model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION:
        raise SerpentError(
            f"{names} cannot be attached: the model's flag `actuation` is off, so that MuJoCo calls no "
            "control callback. Turn it on."
        )
    if several and model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise SerpentError(
            f"{names} cannot be attached: the integrator RK4 computes forces four times in each time step, "
            "and these effects remember. Set model.opt.integrator to implicitfast."
        )
