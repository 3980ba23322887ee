"""What a law changes in what a twin shows, by its simulation and, to first order, by its place."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example import opened

from serpent_twin.effects.law import parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery.rows_in_time import RowsInTime
from serpent_twin.machines.machine import ParameterVector


def numbers(size, first=0.0, second=0.0):
    """A law's eight numbers."""
    return np.array([size, 0.0, 0.0, 0.0, first, second, 0.0, 0.0])


@dataclass(frozen=True)
class Nominal:
    """The nominal twin of a machine, with the segments of its logs."""

    case: Any
    pieces: Any

    @classmethod
    def of(cls, path: Path, logs: Path):
        """Nominal twin of a machine.toml and a folder, or a file, of logs."""
        return cls(*opened(path, logs)[:2])

    def start(self, **effects):
        """The nominal twin with effects."""
        there = {name: np.array(each) for name, each in effects.items()}
        return ParameterVector.nominal(self.case.declared, there)

    def shown(self, at="", values=(), **effects):
        """What it shows with a law of some numbers, and with other effects, (S, T, C)."""
        there = effects | ({f"discovered@{at}": values} if at else {})
        return self.case.machine.respond([self.start(**there)], self.pieces)[0]

    @cached_property
    def plain(self):
        """What it shows."""
        return self.shown()

    @cached_property
    def places(self):
        """Where and what may act on it."""
        return self.case.places(self.start(), self.pieces)

    def changed(self, at="", values=(), **effects):
        """What it shows with these beyond what it shows without."""
        return self.shown(at, values, **effects) - self.plain

    def response(self, at):
        """What changes at the place of a law show."""
        law = parse(at)
        there = {(each.handle, each.place): each for each in self.places.responses}
        return there[law.handle, law.place]

    def reading(self, at):
        """What a law follows, (S, T), and a number at which its shape begins in the middle of that."""
        law = parse(at)
        x = self.places.readings.get((law.reading, law.where), np.zeros(self.pieces.time.shape))
        first = {"play": 0.3 * float(np.ptp(x)), "periodic": 3.0}
        return x, first.get(law.shape, float(np.median(x)))

    def follows(self, at):
        """How the change of a law follows its reading, (S, T)."""
        shape, (x, first) = SHAPES[parse(at).shape], self.reading(at)
        return RowsInTime.among(self.places.readings).followed(shape, x, first, 0.0)

    def change(self, at, rms=2e-3):
        """What a small law shows and what its place says of that, both (S, T, C): changes of such an rms."""
        k = 3 if parse(at).handle == "spring" else 0  # its stiffness
        unit = [*self.response(at).of(self.follows(at)[None])][k][0]
        size = rms / np.sqrt(np.mean(unit**2))
        values = np.roll(numbers(size), k) + numbers(0.0, self.reading(at)[1])
        return self.changed(at, values), size * unit


def assert_alike(found, told, least):
    """Changes have nearly one direction, and nearly one size."""
    sizes = np.linalg.norm(found), np.linalg.norm(told)
    assert np.sum(found * told) > least * np.prod(sizes)
    assert sizes[1] == pytest.approx(sizes[0], rel=0.1)
