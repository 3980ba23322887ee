"""Say which effects act on a model's runs, and what is known of the rows before each run."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from serpent_twin.effects import Effect
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.clocks import clocks_of
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.drives import controls
from serpent_twin.machines.model.full_rate import columns_between
from serpent_twin.machines.model.replay import FollowedSessions
from serpent_twin.machines.model.seen import address, beginning
from serpent_twin.machines.model.starts import angle_of, measured_joints, rate_of
from serpent_twin.machines.model.state_effects import Acting, Earlier, acting_on_state
from serpent_twin.tables.segments import Segments, Stretch, cut


def acting(
    machine: Described,
    model: mujoco.MjModel,
    there: Sequence[Effect],
    x: Mapping[str, float],
    pieces: Segments,
    past: FollowedSessions | None = None,
    twin: int = 0,
) -> Acting | None:
    """The effects on the state of a model's runs, with what they remember at coordinates `x` of the fit; None
    where there are none. What nothing measures, the past of one of several twins says.
    """
    several = acting_on_state(there, model, machine.winches)
    if not several:
        return None
    earlier = None
    recalls = any(each.recalls for each in several) and not pieces.planned
    if recalls and machine.about.lead:
        lasting = ", ".join(type(each).__name__ for each in several if each.recalls)
        raise SerpentError(
            f"the effect {lasting} remembers for longer than the lead of {machine.about.lead:g} s, after "
            f"which segments of {machine.name} count. Leave it out of this twin."
        )
    if recalls and measured_joints(machine):
        earlier = _earlier(machine, model, there, x, pieces, past, twin)
    return Acting([several] * len(pieces), clocks_of(pieces), earlier)


def _earlier(
    machine: Described,
    model: mujoco.MjModel,
    there: Sequence[Effect],
    x: Mapping[str, float],
    pieces: Segments,
    past: FollowedSessions | None,
    twin: int,
) -> Earlier:
    """The sessions of runs, by what is measured of their joints."""
    distinct = pieces.whole
    joints = measured_joints(machine)
    drives = [*(each.column for each in machine.about.drive), *columns_between(machine)]
    columns = [of(joint) for joint in joints for of in (angle_of, rate_of)]
    runs = cut(
        [Stretch.whole(each) for each in distinct], [*drives, *columns], list(joints.values())
    )
    told = controls(machine, there, x, runs)
    pose = np.tile(beginning(model, machine), (*runs.time.shape, 1))
    rate = np.zeros((*runs.time.shape, model.nv))
    if past:
        S, T = runs.time.shape
        pose, rate = past.path(slice(twin * S, (twin + 1) * S), T)
    for joint in joints:
        pose[..., address(model, joint)] = runs.column[angle_of(joint)]
        rate[..., int(model.joint(joint).dofadr[0])] = runs.column[rate_of(joint)]
    for each in (pose, rate):  # while a drive holds what it is told in a row
        each[:, :-1] = (each[:, :-1] + each[:, 1:]) / 2
    parts = told.shape[1] // runs.time.shape[1]
    return Earlier(
        pose, rate, told[:, ::parts], pieces.which, pieces.first, runs.period[pieces.which]
    )
