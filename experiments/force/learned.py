"""Let readouts learn forces from windows of logs of an arm that is pushed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from serpent_twin import readouts
from serpent_twin.arrays import Array
from serpent_twin.readouts.windows import SessionWindows, cut
from serpent_twin.sessions import Session
from serpent_twin.sim.pushes import COLUMNS

_SCALE = 0.1
"""[m/N]: readouts estimate nine places; here the last one is the force, the others stay where they are"""
_TRAIN, _VALIDATE = slice(None, -2), slice(-2, -1)
_EPOCHS = 300
"""Largest number of epochs"""


def before(log: Session) -> tuple[Array, Array]:
    """The link, (T,), and the force [N], (T, 3), that acted until each row."""
    none = np.zeros(len(log.time))
    link, *force = (np.r_[0.0, log.extra.get(name, none)[:-1]] for name in COLUMNS)
    return link.astype(int), np.stack(force, axis=-1)


def learned_errors(
    names: Sequence[str], logs: Sequence[Session], rng: np.random.Generator
) -> dict[str, dict[str, float]]:
    """Error of each readout [N rms] on the last log, pushed and free; the others train and validate it."""
    out = {}
    for name in names:
        kind = readouts.find(name)
        readout = kind()
        if kind.takes("epochs"):
            readout = readout.with_settings(epochs=_EPOCHS)
        every = cut(list(logs), readout.window)
        told = tuple(_told(s, log) for s, log in zip(every.sessions, logs, strict=True))
        train, validate = (replace(every, sessions=told[part]) for part in (_TRAIN, _VALIDATE))
        readout.fit(train, validate, rng)
        test = told[-1]
        off = (readout.predict(test.x, test.start) - test.marker)[:, -1] / _SCALE
        link = before(logs[-1])[0][-len(off) :]
        out[name] = {"pushed": _rms(off[link > 0]), "free": _rms(off[link == 0])}
    return out


def _told(windows: SessionWindows, log: Session) -> SessionWindows:
    """The windows with the force in place of the last marker."""
    marker = windows.marker.copy()
    marker[:, -1] = _SCALE * before(log)[1][-len(marker) :]
    return replace(windows, marker=marker)


def _rms(off: Array) -> float:
    return float(np.sqrt((off**2).sum(axis=1).mean()))
