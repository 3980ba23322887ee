"""Tell commands, which are in force until the next one, from readings, which are interpolated."""

import re
from collections.abc import Mapping
from pathlib import Path

from serpent_twin import stored
from serpent_twin.exchange.map_file import MappedField, MappedStream

MACHINE = "machine.toml"
_COMMAND = re.compile(
    r"actions?|cmds?|command(s|ed)?|controls?|ctrl|demand|desired|goals?|reference|setpoints?|targets?|u"
)
_READING = re.compile(
    r"actual|encoders?|feedback|imu|measured|observation|present|readings?|sensors?|states?"
)


def stated_roles(path: Path | None) -> dict[str, bool]:
    """Whether each column that a machine.toml names is a command: one that drives an actuator, and what
    switches it, are; the motion of a prescribed joint and what is measured are not.
    """
    from serpent_twin.machines.model.description import (  # loads all of a machine
        ADVICE,
        Description,
    )

    if path is None:
        return {}
    about = stored.read_toml(path, Description, ADVICE)
    found = {name: False for each in about.measured for name in each.columns}
    found |= {each.column: bool(each.actuator) for each in about.drive}
    return found | {each.enable: True for each in about.drive if each.enable}


def is_command(stream: MappedStream, each: MappedField, roles: Mapping[str, bool]) -> bool | None:
    """Whether a field is a command, as the map or a machine.toml states or as its names say; None if neither
    does.
    """
    for said in (each.hold, stream.hold, roles.get(each.column), roles.get(each.source)):
        if said is not None:
            return said
    for name in (each.column, each.source, stream.topic):
        words = re.findall(r"[a-z]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", name).lower())
        command, reading = (any(map(of.fullmatch, words)) for of in (_COMMAND, _READING))
        if command != reading:
            return command
    return False if stream.follows else None
