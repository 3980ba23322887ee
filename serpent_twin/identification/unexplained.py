"""Say whether an error is unexplained."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from serpent_twin.identification.bars import BEYOND
from serpent_twin.residual import Findings, describe

SUSPECT = 1.25
"""Times the error of a twin that lacks nothing, above which an error is suspect"""
FOLLOWS = 0.25
"""Share of the squared error above the noise that must depend on a feature, for a suspect error to be
unexplained
"""
LOAD_BEYOND = 1.15
"""Times the loads' noise"""


@dataclass(frozen=True)
class Unexplained:
    """What no effect of the catalogue explains."""

    is_: bool
    share: float
    """Share of the corrected twin's squared error beyond that of a twin that lacks nothing [1]"""
    depends_on: str
    """What the error depends on and where to look, in words"""


def unexplained(
    found: Findings,
    errors: Mapping[str, float],
    load: Mapping[str, float],
    expected: float,
    stuck: Sequence[str] = (),
) -> Unexplained:
    """Whether the corrected twin's error is more than a twin that lacks nothing may make, `expected`, and on
    what it depends; `stuck` tells of each joint that stands still where the corrected twin's turns.
    """
    error = errors["corrected"]
    share = max(0.0, 1 - (expected / error) ** 2) if error > 0 else 0.0
    markers = [d.share_above_noise for d in found.depends_on if d.kind != "load"]
    loads = [d.share_above_noise for d in found.depends_on if d.kind == "load"]
    if found.load_change and found.load_change.settling:
        loads.append(found.load_change.settling.share)
    swings = found.marker_change is not None and found.marker_change.swings
    follows = swings or max(markers, default=0.0) > FOLLOWS
    in_markers = error > BEYOND * expected or (follows and error > SUSPECT * expected)
    floor = found.noise.rms_load_jitter
    in_loads = load["corrected"] > LOAD_BEYOND * floor and max(loads, default=0.0) > FOLLOWS
    if in_loads and not in_markers:
        share = max(0.0, 1 - (floor / load["corrected"]) ** 2)
    is_ = bool(in_markers or in_loads or stuck)
    return Unexplained(is_, share, " ".join([describe(found), *stuck]) if is_ else "")
