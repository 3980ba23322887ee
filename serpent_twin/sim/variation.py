"""Vary the masses and gravity of runs while they step."""

from collections.abc import Sequence

import mujoco
import mujoco.batch
import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import field
from serpent_twin.errors import SerpentError

_DERIVED = (
    "dof_invweight0",
    "tendon_invweight0",
    "body_invweight0",
    "dof_M0",
    "dof_length",
    "dof_solref",
    "dof_solimp",
)
"""MuJoCo's scale of constraints, and the softening of hinge friction that follows from it"""


_VARIED = ("body_mass", "body_subtreemass", "body_ipos", "body_inertia", "opt.gravity")


class Variation:
    """Models of a batch as a first one, and by how much K further ones differ from it.

    Masses on the bodies' long axes and gravity only; raises a `SerpentError` if anything else does.
    """

    def __init__(self, batch: Batch, models: Sequence[mujoco.MjModel]) -> None:
        self._own: dict[str, Array] = {}
        self._linear: dict[str, tuple[Array, Array]] = {}
        of_all = [_moments(model) for model in models]
        for name in mujoco.batch.MODEL_FIELDS:
            all_of = np.array([field(model, name) for model in models])
            if name in _DERIVED or not (all_of != all_of[0]).any():
                continue
            if name not in _VARIED:
                raise SerpentError(
                    f"models that differ in {name} cannot be varied while they run, only masses and gravity."
                )
            first, *others = (each[name] for each in of_all)
            self._own[name], self._linear[name] = batch.expand(name), (first, others - first)

    def set(self, share: Array) -> None:
        """Give every run the first model plus shares of the others' differences, (n, K)."""
        now = {
            name: first + np.tensordot(share, change, 1)
            for name, (first, change) in self._linear.items()
        }
        if "body_ipos" in now:
            mass = np.maximum(now["body_mass"], 1e-12)[..., None]
            now["body_ipos"] = now["body_ipos"] / mass
            now["body_inertia"] = now["body_inertia"] - mass * _across(now["body_ipos"])
        for name, own in self._own.items():
            own[...] = now[name].reshape(np.shape(own))


def _moments(model: mujoco.MjModel) -> dict[str, Array]:
    """The fields that may vary, as what is linear in a mass: instead of centres and inertias, the first
    moments [kg m] and the inertias about the bodies' own origins [kg m²].
    """
    mass, centre = model.body_mass[:, None], model.body_ipos
    return {name: field(model, name) for name in _VARIED} | {
        "body_ipos": mass * centre,
        "body_inertia": model.body_inertia + mass * _across(centre),
    }


def _across(place: Array) -> Array:
    """Squared distances of places on an axis from the frame's axes, (…, 3)."""
    return (place**2).sum(axis=-1, keepdims=True) - place**2
