"""List the effects that a machine may have and its nominal twin leaves out.

You provide a frozen dataclass that inherits `Effect`: its fields are the parameters, each made by
`parameter`; `edit` writes what MJCF can express, `act` does what it cannot; `shows_in` and `confused_with`
are printed in a diagnosis. The effect's name is that of the class: nothing else is to be edited.
`KNOWN` has them all; each machine's candidates are a choice of them. The twin, the bus, the device and
the trace find an effect here.
"""

import serpent_twin.mujoco_log  # noqa: F401 before anything warns
from serpent_twin.effects.acting import act, begin, longest_step, stack, stacked
from serpent_twin.effects.effect import (
    CABLE,
    READING,
    Effect,
    Range,
    Several,
    edit,
    parameter,
    ranges,
    strengths,
)
from serpent_twin.effects.instant import Instant
from serpent_twin.effects.registry import (
    KNOWN,
    Stored,
    StoredAnywhere,
    by_name,
    law_of,
    name_of,
    place_of,
    placed,
    require_distinct,
    restored,
    to_dict,
)

__all__ = [
    "CABLE",
    "KNOWN",
    "READING",
    "Effect",
    "Instant",
    "Range",
    "Several",
    "Stored",
    "StoredAnywhere",
    "act",
    "begin",
    "by_name",
    "edit",
    "law_of",
    "longest_step",
    "name_of",
    "parameter",
    "place_of",
    "placed",
    "ranges",
    "require_distinct",
    "restored",
    "stack",
    "stacked",
    "strengths",
    "to_dict",
]
