"""Say which effects act on a model's state in each time step, and on which runs."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects import CABLE, Effect, name_of
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.effect import WINDING
from serpent_twin.effects.law import FORCES, POSITIONS, READING_SHIFT
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.actuator_numbers import is_dc_motor
from serpent_twin.machines.model.clocks import Clocks
from serpent_twin.machines.model.springs import single_joints
from serpent_twin.numerals import listed

_TORQUE = "drive_torque"
_TIMES = ("time", "runtime")
_FOLLOWED_AT_REST = {
    **dict.fromkeys(
        ("joint_torque", *FORCES, "slack"), ("joint_angle", "tension", *POSITIONS, *_TIMES)
    ),
    READING_SHIFT: ("joint_angle", *_TIMES),
}
"""What laws change of a model at rest, and what they may follow, besides those of commands"""


def acting_on_state(
    there: Sequence[Effect], model: mujoco.MjModel, winches: Collection[str] = ()
) -> list[Effect]:
    """The effects that read a model's state in each time step; `winches` are its joints whose motion is
    prescribed.
    """
    return [each for each in there if acts_on_state(each, model, winches) and not each.absent]


def acting_at_rest(there: Sequence[Effect], model: mujoco.MjModel) -> list[Effect]:
    """The laws that act on a model at rest; raises a `SerpentError` of an effect that acts in time steps, or
    on readings that are late, of which poses have none.
    """
    several = acting_on_state(there, model)
    for each in [*several, *(each for each in there if each.of_readings and not each.absent)]:
        if not isinstance(each, Discovered):
            raise SerpentError(
                f"the effect {name_of(each)} acts in motion, and the rows of this log are poses at rest. "
                "Leave it out of this twin."
            )
        followed = _FOLLOWED_AT_REST.get(each.law.handle, ())
        if not followed:
            raise SerpentError(
                f"the law {str(each.law)!r} acts in motion, and the rows of this log are poses at rest, of "
                f"which laws change {listed(_FOLLOWED_AT_REST)}. Leave it out of this twin."
            )
        if each.law.reading not in ("", *followed):
            raise SerpentError(
                f"the rows of this log are poses at rest, in which {each.law.handle} follows no "
                f"{each.law.depends_on}; there are: {listed(followed)}. Leave it out of this twin."
            )
    return several


def acts_on_state(effect: Effect, model: mujoco.MjModel, winches: Collection[str] = ()) -> bool:
    """Whether an effect acts in each time step: one on what an actuator gives does so where that follows from
    the state, and one between a motor and its winch where the motor's motion is prescribed.
    """
    if not effect.acts() or effect.of_readings or (effect.sites_later and winches):
        return False
    if effect.acts_at >= CABLE:
        return True
    winds = effect.acts_at == WINDING and not effect.needs and not isinstance(effect, Discovered)
    at = state_driven(model) if _TORQUE in effect.needs else winches if winds else ()
    return any(effect.at in ("", name) for name in at)


def state_driven(model: mujoco.MjModel) -> list[str]:
    """The actuators of single joints whose torque follows from the joint's state: DC motors."""
    moved = np.isin(model.actuator_trnid[:, 0], single_joints(model))
    there = is_dc_motor(model) & moved & (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT)
    return [model.actuator(int(n)).name for n in np.flatnonzero(there)]


@dataclass(frozen=True)
class Earlier:
    """U sessions as they were measured, from which effects remember what was before the S runs."""

    pose: Array
    """Mean pose from each row to the next, (U, K, nq)"""
    rate: Array
    """Mean rate from each row to the next, (U, K, nv)"""
    told: Array
    """What the drives tell the actuators, (U, K, nu)"""
    session: NDArray[np.intp]
    """Which is each run's, (S,)"""
    rows: NDArray[np.intp]
    """Number of rows before each run, (S,)"""
    period: Array
    """Between rows of each run's session [s], (S,)"""


@dataclass(frozen=True)
class Acting:
    """Effects on the state of S runs, and when these begin."""

    several: Sequence[Sequence[Effect]]
    """Effects of each run, at least one, (S,)"""
    clocks: Clocks
    """When the runs begin"""
    earlier: Earlier | None = None
    """Where an effect remembers what was before a run"""


def together(several: Sequence[Acting]) -> Acting:
    """The effects of some twins on the runs of each, one twin after the other."""
    first = several[0].earlier
    earlier = None
    if first is not None:
        all_of = [each.earlier or first for each in several]
        whole = {
            name: np.concatenate([getattr(each, name) for each in all_of])
            for name in ("pose", "rate", "told", "rows", "period")
        }
        session = [each.session + n * len(each.pose) for n, each in enumerate(all_of)]
        earlier = Earlier(**whole, session=np.concatenate(session))
    return Acting(
        [each for one in several for each in one.several],
        Clocks.together([each.clocks for each in several]),
        earlier,
    )
