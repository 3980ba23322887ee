"""Measure how well a body computes: memory, products of inputs, separation and consistency.

`memory` and `capacities` measure which functions of past inputs its states hold, `expand` which of them a
task needs, `beyond_taps` what the body adds to its last commands. `state_rank` counts the inputs that it
separates; `channel_consistency`, `consistency_spectrum` and `contraction_rate` measure its repeatability.
Arrays in, arrays out; a delay counts rows. States (T, N) and inputs
(T, m) may be S series of runs side by side, (S, T, N) and (S, T, m): each has its own washout, no delay
reaches from one into another, and their rows count together.
"""

from serpent_twin.reservoir.basis import Basis, basis, chance_cut
from serpent_twin.reservoir.capacity import (
    Capacities,
    LinearMemory,
    capacities,
    memory,
)
from serpent_twin.reservoir.consistency import (
    channel_consistency,
    consistency_spectrum,
    contraction_rate,
    distance,
)
from serpent_twin.reservoir.expansion import Expansion, expand
from serpent_twin.reservoir.inputs import check_inputs
from serpent_twin.reservoir.leak import BeyondTaps, beyond_taps, taps
from serpent_twin.reservoir.rank import state_rank, streams
from serpent_twin.reservoir.targets import Product, label, legendre

__all__ = [
    "Basis",
    "BeyondTaps",
    "Capacities",
    "Expansion",
    "LinearMemory",
    "Product",
    "basis",
    "beyond_taps",
    "capacities",
    "chance_cut",
    "channel_consistency",
    "check_inputs",
    "consistency_spectrum",
    "contraction_rate",
    "distance",
    "expand",
    "label",
    "legendre",
    "memory",
    "state_rank",
    "streams",
    "taps",
]
