"""What can be wrong with an arm that the nominal twin leaves out? One file here is one effect.

You provide a frozen dataclass that inherits `Effect`: its fields are the parameters, each made by
`parameter`; `edit` says what MJCF can express, `act` what it cannot; `shows_in` and `confused_with`
tell the reader of a diagnosis. The file's name is the effect's name: nothing else is to be edited.
The twin, the bus, the device and the trace find it here.
"""

from serpent_twin.effects.effect import Effect, Range, Several, parameter, ranges, stack
from serpent_twin.effects.moment import Moment
from serpent_twin.effects.registry import CATALOGUE, by_name, from_dict, name_of, to_dict

__all__ = [
    "CATALOGUE",
    "Effect",
    "Moment",
    "Range",
    "Several",
    "by_name",
    "from_dict",
    "name_of",
    "parameter",
    "ranges",
    "stack",
    "to_dict",
]
