"""Say what changes at sensors and at motors of known motion would show, where sites place the joints."""

from collections.abc import Iterator, Mapping, Sequence

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import HANDLES
from serpent_twin.engine.row_changes import against
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.motion import DrivenMotion, RowStates
from serpent_twin.machines.model.state_moment import fixed
from serpent_twin.machines.model.things import tendon_levers
from serpent_twin.machines.model.variants import Variants
from serpent_twin.machines.places import LaggedResponse, PlaceResponse, Response

_OF_CAMERAS = ("camera_shift", "camera_turn", "camera_delay")


def of_sensors(
    machine: Described, motion: DrivenMotion, states: RowStates, bodies: Sequence[str]
) -> Iterator[Response]:
    """What changes of what is seen would show, in the same row: shifts of sites, turns of bodies that carry
    some, all that cameras see, and what efforts read.
    """
    sites = [each for each in machine.about.measured if each.site and each.cameras]
    wanted = [("marker_shift", each.site) for each in sites]
    wanted += [("link_turn", name) for name in bodies]
    frame = next((each.frame for each in sites if each.frame), "world")
    wanted += [(handle, frame) for handle in _OF_CAMERAS if sites]
    columns = [name for each in machine.efforts.values() for name in each.columns]
    wanted += [(handle, name) for handle in ("load_shift", "load_scale") for name in columns]
    changes = _by_units(motion, states, wanted)
    for (handle, place), change in zip(wanted, changes, strict=True):
        yield PlaceResponse(handle, place, change)


def _by_units(
    motion: DrivenMotion, states: RowStates, wanted: Sequence[tuple[str, str]]
) -> list[Array]:
    """Change of the prediction by a unit of each component of quantities at places, (d, S, T, C) each."""
    driven, seen = motion.driven, motion.seen
    runs = Variants(driven, driven.models, states.step)
    seen.bind(runs.batch, driven.models)
    views = seen.views(runs.batch)
    units = [np.eye(HANDLES[handle].components)[:, None] for handle, _ in wanted]
    rows = []
    for t in range(states.pose.shape[1]):
        fields = {"qpos": states.pose, "qvel": states.rate, "qfrc_applied": states.applied}
        runs.put(t, **{name: values[:, t] for name, values in fields.items()})
        runs.batch.forward(stage=seen.stage)
        shown = seen.read(runs.batch, runs.older)
        rows.append(
            [
                [views.change(*at, np.repeat(unit, len(shown), 0), shown) for unit in several]
                for at, several in zip(wanted, units, strict=True)
            ]
        )
    return [np.nan_to_num(np.stack(each, axis=2)) for each in zip(*rows, strict=True)]


def of_motors(
    machine: Described,
    model: mujoco.MjModel,
    states: RowStates,
    slack: Mapping[str, LaggedResponse],
) -> Iterator[Response]:
    """What changes at motors whose effort is measured would show: torque and friction of their gears in the
    effort of the same row, and an angle at what hangs on them as their tendons' slack does.
    """
    names = [name for each in machine.about.measured for name in each.columns]
    for joint, each in machine.efforts.items():
        rate = states.rate[..., [int(model.joint(joint).dofadr[0])]]
        effort = np.zeros((*states.rate.shape[:2], len(names)))
        effort[..., names.index(each.columns[0])] = 1.0
        yield PlaceResponse("motor_torque", joint, -effort[None])
        yield PlaceResponse("gear_friction", joint, (-against(rate) * effort)[None])
    levers = levers_at_rest(model)
    for joint in machine.winches:
        by = levers[:, int(model.joint(joint).dofadr[0])]
        each = [(-float(by[model.tendon(name).id]), of) for name, of in slack.items()]
        if winds := [one for one in each if one[0]]:
            yield _sum("winch_angle", joint, winds)


def levers_at_rest(model: mujoco.MjModel) -> Array:
    """Change of the length of each tendon with the degrees of freedom in the pose of the drawn model,
    (ntendon, nv) [m/rad or 1].
    """
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    return tendon_levers(model, data)


def of_frame(
    model: mujoco.MjModel, forces: Mapping[str, LaggedResponse]
) -> Iterator[LaggedResponse]:
    """What an acceleration of all that does not move would show: forces against it on bodies."""
    weighed = [(-float(model.body(name).mass[0]), each) for name, each in forces.items()]
    if weighed:
        yield _sum("acceleration", fixed(model)[-1], weighed)


def _sum(
    handle: str, place: str, several: Sequence[tuple[float, LaggedResponse]]
) -> LaggedResponse:
    """The response to several changes together, each of a size."""
    enters, own = (
        np.sum([size * getattr(one, of) for size, one in several], axis=0)
        for of in ("enters", "own")
    )
    return LaggedResponse(handle, place, several[0][1].motion, enters, own)
