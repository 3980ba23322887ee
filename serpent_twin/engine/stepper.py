"""Step runs of any machine side by side, effects acting before every time step."""

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar

import mujoco
import mujoco.batch
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Instant
from serpent_twin.errors import SerpentError

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_UNEQUAL = (
    "runs side by side need models of one structure, which some effects change: give what is absent "
    "in some of the runs a tiny strength, or run those apart."
)

M = TypeVar("M", bound=Instant)


class Stepper(ABC, Generic[M]):
    """Runs that step side by side, run i with the effects of several[i].

    A machine's stepper says what an instant of it is, and how what effects changed there is written into
    the batch. Which effects act, in which order and with which memories is decided here alone.
    """

    def __init__(self, batch: Batch, several: Sequence[Sequence[Effect]]) -> None:
        self.batch = batch
        self._effects = effects.stacked(several)
        self.acting = bool(self._effects)
        """Whether any effect acts, so that Python runs in time steps"""
        self.moving = not all(effect.only_seen for effect in self._effects)
        """Whether any changes more than what sensors show, so that Python runs in every time step"""
        self._memory: list[Any] = []
        self._unseen: tuple[Sequence[Effect], Sequence[Any]] = (), ()
        self.longest_step = np.full(len(several), np.inf)
        """Longest time step that the effects' memories follow [s], (n,)"""

    @abstractmethod
    def apply(self, moment: M) -> None:
        """Write into the batch what the effects have made of an instant."""

    def begin(self, moment: M) -> None:
        """Begin a run: reset the effects' memories."""
        self._memory = effects.begin(self._effects, moment)
        moving = [i for i, effect in enumerate(self._effects) if not effect.only_seen]
        self._unseen = [self._effects[i] for i in moving], [self._memory[i] for i in moving]
        self.longest_step = effects.longest_step(self._effects, moment, len(self.longest_step))

    def act(self, moment: M, seen: bool = True) -> M:
        """Let the effects act on the next time step, and apply what they changed; in a step that is not seen,
        without those that change only what sensors show.
        """
        several, memories = (self._effects, self._memory) if seen else self._unseen
        effects.act(several, moment, memories)
        self.apply(moment)
        return moment


def structure(model: mujoco.MjModel) -> tuple[object, ...]:
    """The sizes of state and fields, which models that step side by side must share."""
    shapes = [np.shape(field(model, name)) for name in mujoco.batch.MODEL_FIELDS]
    return mujoco.mj_stateSize(model, _STATE), *shapes


def field(model: mujoco.MjModel, name: str) -> Array:
    """A field of a model, or of its options if the name begins with `opt.`."""
    owner, _, of = name.rpartition(".")
    return getattr(model.opt if owner == "opt" else model, of)


def side_by_side(models: Sequence[mujoco.MjModel], nthread: int) -> Batch:
    """A batch whose run i is of models[i]; all must be of one structure."""
    stop_profiling()
    distinct = {id(model): model for model in models}
    for model in distinct.values():
        # An unstable run that resets itself would warn in every step.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        if model.ntree == 1:  # A search for islands of constraints takes a seventh of the time.
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    batch = Batch(models[0], len(models), nthread)
    if len({structure(model) for model in distinct.values()}) > 1:
        raise SerpentError(_UNEQUAL)
    for name in mujoco.batch.MODEL_FIELDS:
        of = {n: field(model, name) for n, model in distinct.items()}
        first, *others = of.values()
        if any(not np.array_equal(value, first) for value in others):
            values = np.array([of[id(model)] for model in models])
            batch.expand(name)[...] = values.reshape(len(models), *np.shape(first))
    return batch


@cache
def stop_profiling() -> None:
    """Let MuJoCo leave `MjData.timer` as it is: its Python bindings make it read the clock some twenty times
    in a step, which is a third of a small model's time, and `set_mjcb_time(None)` does not end that.
    """
    for pattern in ("libmujoco*", "mujoco.dll"):
        for library in Path(mujoco.__file__).parent.glob(pattern):
            ctypes.c_void_p.in_dll(ctypes.CDLL(str(library)), "mjcb_time").value = None


def set_timestep(batch: Batch, timestep: Array) -> None:
    """Let each run take its own time steps [s], (n,) or (n, 1)."""
    own = batch.expand("opt.timestep")
    own[...] = timestep.reshape(np.shape(own))


def addresses(
    model: mujoco.MjModel, names: Sequence[str]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Addresses of joints of these names in qpos and in qvel."""
    joints = [model.joint(name) for name in names]
    return (
        np.array([int(j.qposadr[0]) for j in joints], np.intp),
        np.array([int(j.dofadr[0]) for j in joints], np.intp),
    )


def in_a_row(indices: NDArray[np.intp]) -> NDArray[np.intp] | slice:
    """Indices as a slice where each follows the other: NumPy reads and writes that in a third of the time."""
    if not len(indices):
        return indices
    first, last = int(indices[0]), int(indices[-1]) + 1
    return slice(first, last) if np.array_equal(indices, np.arange(first, last)) else indices
