"""Hold what is drawn of a live estimate."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from serpent_twin.arrays import Array


@dataclass(frozen=True)
class Page:
    """What is drawn, and where it goes."""

    readout: str
    """What estimates"""
    about: str
    """Text on the arm that is estimated"""
    file: Path | None
    """The recording to write, if any"""
    view: bool
    """Whether the viewer shows it meanwhile"""
    feels: bool = False
    """Whether a force is estimated, too"""


class Sample(NamedTuple):
    """What is drawn of one row."""

    time: float
    """[s]"""
    motor: Array
    """[rad], (10,)"""
    load: Array
    """Fraction of the stall torque, (10,)"""
    measured: Array
    """[m], (9, 3), NaN where lost"""
    estimated: Array
    """[m], (9, 3), NaN where unknown"""
    covariance: Array
    """[m²], (9, 3, 3), NaN where unknown"""
    latency_ms: float
    """Time from the reading to the estimate [ms]"""
    force: Array
    """[N], (3,), NaN if none is estimated"""
    force_covariance: Array
    """[N²], (3, 3)"""
    link: int
    """Link on which the force acts, 1 … 9"""
    touched: bool
    """Whether contact is reported"""
