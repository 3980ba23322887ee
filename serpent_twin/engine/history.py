"""Fill the histories of delayed sensors at the start of a run."""

import numpy as np
from mujoco.batch import Batch


class History:
    """Past readings of delayed sensors, which MuJoCo starts at zero."""

    def __init__(self, batch: Batch) -> None:
        model = batch.model
        self._batch = batch
        self._slots: list[tuple[slice, slice, int]] = []
        for n in np.flatnonzero(model.sensor_history[:, 0]):
            samples, size = int(model.sensor_history[n, 0]), int(model.sensor_dim[n])
            at = int(model.sensor_historyadr[n]) + 2 + samples  # two words, the times, the values
            read = int(model.sensor_adr[n])
            slot = (slice(at, at + samples * size), slice(read, read + size), samples)
            self._slots.append(slot)
        if self._slots:
            self._delay, self._past = batch.expand("sensor_delay"), batch.bind("history")
            self._sensors = batch.bind("sensordata")

    def fill(self) -> None:
        """Fill the history of every delayed sensor with its present reading."""
        if not self._slots:
            return
        delay = self._delay.copy()
        self._delay[...] = 0.0
        self._batch.forward()
        for past, read, samples in self._slots:
            self._past[:, past] = np.tile(self._sensors[:, read], samples)
        self._delay[...] = delay
