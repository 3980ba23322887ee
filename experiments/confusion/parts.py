"""Judge the intervals of a bench arm's parts: geometry and masses are known, and mean the same in the twin.

A trace states some sixty such numbers, so a few arms show whether its standard errors are right. The cameras'
frame is none of them: its numbers count from a trace's first guess.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.confusion.score import Share
from serpent_twin.arm.geometry import ARM

_AXES = "xyz"


def true_parts(parameters: Mapping[str, Any]) -> dict[str, float]:
    """The numbers of a bench arm's parts, by their names in a diagnosis, in the unit of the interval there:
    mm, m, kg or mrad.
    """
    true = {}
    markers = 1e3 * (ARM.markers_in_links + np.array(parameters["marker_offset"]))
    lengths = np.array(ARM.link_length) * parameters["length_ratio"]
    masses = np.array(ARM.link_mass) * parameters["mass_ratio"]
    links = zip(markers, lengths, masses, parameters["axis_tilt"], strict=True)
    for link, (marker, length, mass, (along, across)) in enumerate(links, 1):
        places = zip(_AXES, marker, strict=True)
        true |= {f"site {x} of marker{link}": at for x, at in places}
        true |= {f"body x of link{link + 1}": length, f"mass of link{link}": mass}
        true[f"joint axis x of joint{link}"] = 1e3 * along
        side, axis = (-1e3, "y") if link % 2 else (1e3, "z")  # hinges about z and y in turn
        true[f"joint axis {axis} of joint{link}"] = side * across
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
