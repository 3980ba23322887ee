"""Compose effects that no catalogue lists: a law at a place, found in what the twin leaves of the logs."""

from serpent_twin.identification.discovery.candidates import always, with_laws
from serpent_twin.identification.discovery.discover import discover, in_each_shape
from serpent_twin.identification.discovery.free_curve import FreeCurve, free_curve
from serpent_twin.identification.discovery.resembling import (
    composed_law,
    elsewhere,
    of_shape,
    turned,
)
from serpent_twin.identification.discovery.steps_alike import steps_alike
from serpent_twin.identification.discovery.stuck import stuck
from serpent_twin.identification.discovery.thresholds import better_thresholds

__all__ = [
    "FreeCurve",
    "always",
    "better_thresholds",
    "composed_law",
    "discover",
    "elsewhere",
    "free_curve",
    "in_each_shape",
    "of_shape",
    "steps_alike",
    "stuck",
    "turned",
    "with_laws",
]
