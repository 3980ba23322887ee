"""Readouts and estimators with numbers in place of what they would learn."""

import numpy as np

from serpent_twin.estimators import kind_of
from serpent_twin.readouts.trainable import Trainable

SMALL = {"width": 6, "layers": 2}


def settings(name: str) -> dict:
    return {k: v for k, v in SMALL.items() if kind_of(name).trained.takes(k)}


def made(name: str) -> Trainable:
    """A readout or estimator with numbers in place of what it would learn."""
    if name == "adapted":
        readout = kind_of(name).trained(
            base="linear", settings=kind_of("linear").trained().config()
        )
    else:
        readout = kind_of(name).trained(**settings(name))
    rng = np.random.default_rng(0)
    for key, wanted in readout.wanted().items():
        values = rng.uniform(0.5, 1.0, wanted.shape)
        if wanted.covariance:
            values = np.broadcast_to(np.eye(wanted.shape[-1]), wanted.shape)
        readout.learned[key] = values
    readout.rate_hz, readout.covariance = 4.0, np.tile(np.eye(3), (9, 1, 1))
    return readout
