"""Find the files that a model is made of, which must lie in one folder."""

import re
from pathlib import Path

from serpent_twin import stored
from serpent_twin.errors import SerpentError

_FILE = re.compile(r"""\bfile\s*=\s*["']([^"']+)["']""")
_FOLDER = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"']*)["']""")


def files(description: Path, model: str) -> list[Path]:
    """A machine.toml, its MJCF, and the files that this includes; raises a `SerpentError` for one that lies
    outside the folder of the machine.toml.
    """
    folder = description.parent.resolve()
    found, left = [description], [folder / model]
    while left:
        file = left.pop()
        if not file.resolve().is_relative_to(folder):
            raise SerpentError(
                f"{description}: model needs {file}, outside the folder of machine.toml. Put a copy of it "
                "there, so that the folder is the whole machine."
            )
        if file in found or (len(found) > 1 and not file.is_file()):
            continue
        found.append(file)
        if file.suffix == ".xml":
            advice = f"{description}, model: name the MJCF file."
            text = stored.contents(file, advice=advice).decode(errors="replace")
            folders = [file.parent, *(file.parent / each for each in _FOLDER.findall(text))]
            left += [at / name for name in _FILE.findall(text) for at in folders]
    return found
