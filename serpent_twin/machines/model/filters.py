"""Follow filters of commands through whole sessions, which needs no simulation of the machine."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from serpent_twin.arrays import Array
from serpent_twin.machines.model.full_states import FullStates
from serpent_twin.machines.model.stepped_runs import DrivenRuns


@dataclass(frozen=True)
class FilteredSessions:
    """Activations of filters in n whole sessions."""

    activation: Array
    """Activations of the filters in each row, (n, T, na)"""
    begin: Array
    """The pose of what nothing measures, (nq,)"""
    dofs: int

    def at(self, session: NDArray[np.intp], row: NDArray[np.intp]) -> FullStates:
        """States in some rows of some sessions, (k,) each, but for measured joints."""
        k = len(row)
        pose, rate = np.tile(self.begin, (k, 1)), np.zeros((k, self.dofs))
        return FullStates(pose, rate, self.activation[session, row], np.zeros((k, 0)))


def only_filters(model: mujoco.MjModel) -> bool:
    """Whether all activations are exact filters of first order of the actuators' controls."""
    exact = model.actuator_dyntype == mujoco.mjtDyn.mjDYN_FILTEREXACT
    plain = (model.actuator_actnum[exact] == 1) & ~model.actuator_actlimited[exact].astype(bool)
    return not model.nhistory and bool(plain.all()) and int(exact.sum()) == model.na


def filtered(driven: DrivenRuns, begin: Array) -> FilteredSessions:
    """Filters that follow the controls of whole sessions, at rest under the first ones."""
    first, told = driven.models[0], driven.told
    parts, n = told.shape[1] // driven.rows, len(told)
    found = np.empty((n, driven.rows, first.na))
    for a in np.flatnonzero(first.actuator_dyntype == mujoco.mjtDyn.mjDYN_FILTEREXACT):
        for k, (model, period) in enumerate(zip(driven.models, driven.period, strict=True)):
            low, high = model.actuator_ctrlrange[a]
            control = told[k, :, a]
            if model.actuator_ctrllimited[a]:
                control = np.clip(control, low, high)
            lag = max(float(model.actuator_dynprm[a, 0]), mujoco.mjMINVAL)
            kept = np.exp(-period / parts / lag)
            past, _ = lfilter([0.0, 1 - kept], [1.0, -kept], control, zi=[control[0]])
            found[k, :, model.actuator_actadr[a]] = past[::parts]
    return FilteredSessions(found, begin, first.nv)
