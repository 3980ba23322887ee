"""Write a twin as MJCF, for MuJoCo and all that reads its models."""

from serpent_twin.engine.exact_xml import to_xml
from serpent_twin.interchange.exported import Exported, Format, Given, noted


def _write(given: Given) -> Exported:
    """The twin.xml, with a comment on what it lacks."""
    lacks = tuple(f"{each}: serpent_twin.attach adds it, from twin.json" for each in given.beside)
    return Exported(f"<!--\n{noted(lacks, ' ')}\n-->\n{to_xml(given.spec, given.folder)}\n", lacks)


FORMAT = Format("MuJoCo's MJCF", _write)
