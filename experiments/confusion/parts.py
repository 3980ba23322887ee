"""Judge the intervals of a bench arm's parts: geometry and masses are known, and mean the same in the twin.

A trace states some seventy such numbers, so a few arms show whether its standard errors are right.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.confusion.score import Share
from serpent_twin.arm.geometry import ARM

_AXES = "xyz"


def true_parts(parameters: Mapping[str, Any]) -> dict[str, float]:
    """The numbers of a bench arm's parts, by their names in a diagnosis, in the unit of the interval there:
    mm, g or mrad.
    """
    true = {}
    markers = 1e3 * (ARM.markers_in_links + np.array(parameters["marker_offset"]))
    lengths = 1e3 * np.array(ARM.link_length) * parameters["length_ratio"]
    masses = 1e3 * np.array(ARM.link_mass) * parameters["mass_ratio"]
    links = zip(markers, lengths, masses, parameters["axis_tilt"], strict=True)
    for link, (marker, length, mass, (along, across)) in enumerate(links, 1):
        places = zip(_AXES, marker, strict=True)
        true |= {f"place of marker {link}, {x} in its link's frame": at for x, at in places}
        true |= {f"length of link {link}": length, f"mass of link {link}": mass}
        true[f"lean of axis {link}, along its link"] = 1e3 * along
        true[f"lean of axis {link}, across"] = 1e3 * across
    for n, x in enumerate(_AXES):
        true[f"cameras along {x}"] = 1e3 * parameters["camera_shift"][n]
        true[f"cameras about {x}"] = 1e3 * parameters["camera_turn"][n]
    return {name: float(value) for name, value in true.items()}


def parts_held(calibration: Mapping[str, Mapping[str, Any]], truth: Mapping[str, Any]) -> Share:
    """How many of them lie in the 95 % intervals of a diagnosis, which has none of the last link's length."""
    true, held, stated = true_parts(truth["parameters"]), 0, 0
    for entry in calibration.values():
        if entry["quantity"] in true:
            (low,) = (value for name, value in entry.items() if name.startswith("low_"))
            (high,) = (value for name, value in entry.items() if name.startswith("high_"))
            stated += 1
            held += low <= true[entry["quantity"]] <= high
    return Share(held, stated)
