"""Find what acts on the joints by the torques that they lacked, where the pose is no linear answer to it.

A strong force takes the machine to where other cables pull, so that to first order around the twin's pose,
what follows the moved pose itself explains most. In the balance of torques at the measured pose, forces add
up.
"""

import numpy as np

from serpent_twin.identification.discovery.composed import Composed
from serpent_twin.identification.discovery.screen import Search
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.objective import variance_inflation
from serpent_twin.machines.places import Places

_LEAST = 1e-3
"""Noise of a joint's missing torque at least [N m]"""


def screened_by_torques(places: Places) -> list[Composed]:
    """The best laws at each place, the best first, by the torques that the joints lacked, of which they would
    remove their shares; none of a machine that does not say.

    What free parameters could do is left to the trials.
    """
    missing = places.missing_torques
    if missing is None:
        return []
    noise = np.sqrt((missing.torque**2).mean(axis=(0, 1)))
    scale = np.broadcast_to(1 / np.maximum(noise, _LEAST), missing.torque.shape)
    residual = missing.torque * scale
    weight = 1 / variance_inflation(residual, scale.shape[-1])
    none = Information(np.zeros((0, residual.size)), weight, np.zeros(0), np.zeros(0))
    return Search(residual, scale, none, places.readings).best(missing.responses)
