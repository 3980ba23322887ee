"""Say what forces on a link of the arm change, by what one in the base frame does."""

from collections.abc import Iterator

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import SPRING
from serpent_twin.machines.places import PlaceResponse


def by_forces(name: str, world: Array, rotation: Array, middle: Array) -> Iterator[PlaceResponse]:
    """Of a force in the base frame, of one in the link's frame, and of a spring: `world` is the change of
    anything by the first, (3, S, T, C), `rotation` the link's, (S, T, 3, 3), `middle` its centre of mass [m],
    (S, T, 3).
    """
    yield PlaceResponse("force", name, world)
    own = np.einsum("stxy,xstc->ystc", rotation, world)
    yield PlaceResponse("force_in_body", name, own)
    slack = -np.einsum("stx,xstc->stc", middle, world)
    yield PlaceResponse(SPRING, name, np.concatenate([world, slack[None]]))
