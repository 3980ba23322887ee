"""The commands of README and docs in their order, and each made small."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import yaml
from paths import ROOT

from serpent_twin.command_line.verbs import verbs

_BLOCK = r"^ {4}(?P<block>(?:python|serpent-twin|make|dask|source) .*)$"
_INLINE = r"`(?P<inline>(?:python|serpent-twin|make|source) [^`]+)`"
_ADAPTER = "/dev/serial/by-id/*"

SMALL: tuple[tuple[str, str], ...] = (
    # command that begins so, options that are put in place of its own or added
    ("collect --backend real --out arm_logs", "--sessions 1 --steps 240"),
    ("collect --backend real", ""),
    ("collect", "--sessions 3 --steps 170 --workers 1"),
    ("train --logs corrected", "--adapt-windows 0,all --readout linear observer"),
    ("train", "--epochs 1 --windows 1,2"),
    ("trace", "--sessions 2"),
    ("estimate", "--steps 40"),
    (
        "replay data/arm_a/session_04.parquet --twin data/arm_a_trace/twin.json --mp4",
        "--between 100 101",
    ),
    (
        "sweep",
        "--stiffness 8e3 --slack 3e-4 --seeds 0 --rate 20 --amplitude 0.014 --steps 200 --delays 4 2 "
        "--memory-delay 6 --taps 1 --stretches 10 --washout 8 --repeated 20 --stream 2 --coarsest 10 "
        "--sessions 3 --session-steps 120 --readouts analytical residual --workers 1",
    ),
)
ONLY_IN_PLACE = ("--adapt-windows", "--windows")
"""Options that SMALL puts in place of the command's own, and never adds"""
LAST_SESSION = ("session_23", "session_04"), "session_03"
"""Sessions that there are in 23, and the last one of a small run"""


def pages() -> list[Path]:
    """README.md, then the pages of the site in the order of its navigation."""
    site = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    return [ROOT / "README.md", *(ROOT / "docs" / name for name in _leaves(site["nav"]))]


def _leaves(navigation: str | list | dict) -> Iterator[str]:
    if isinstance(navigation, str):
        yield navigation
        return
    for each in navigation.values() if isinstance(navigation, dict) else navigation:
        yield from _leaves(each)


def commands() -> list[str]:
    """What a reader of the pages has to type, without comments, each once.

    `serpent-twin bus doctor` becomes `python -m serpent_twin.bus.doctor`, which tests can run in a checkout.
    """
    text = "\n".join(page.read_text() for page in pages())
    found = re.finditer(f"{_BLOCK}|{_INLINE}", text, re.MULTILINE)
    typed = [re.sub(r"\s*\n\s*", " ", match["block"] or match["inline"]) for match in found]
    return list(dict.fromkeys(as_module(re.split(r"\s{2,}#", text)[0].strip()) for text in typed))


def as_module(command: str) -> str:
    """A command of the package as a run of its module; other commands as they are."""
    name, _, rest = command.removeprefix("serpent-twin ").partition(" ")
    if not command.startswith("serpent-twin ") or name.startswith("-"):
        return command
    verb, _, after = rest.partition(" ")
    if f"{name}.{verb}" in verbs():
        name, rest = f"{name}.{verb}", after
    return f"python -m serpent_twin.{name} {rest}".rstrip()


def module(command: str) -> str:
    """The verb of a command of the package, such as `collect` or `bus.doctor`; else nothing."""
    found = re.match(r"python -m serpent_twin\.(\S+)", command)
    return found[1] if found else ""


def options(words: list[str]) -> dict[str, list[str]]:
    """Options with their values; what stands before them is under the empty name."""
    found: dict[str, list[str]] = {"": []}
    name = ""
    for word in words:
        if re.match(r"--\D", word):
            found[name := word] = []
        else:
            found[name].append(word)
    return found


def small(command: str, adapter: str = _ADAPTER) -> list[str]:
    """The words after `python` of a command of the package, with few and short sessions.

    `adapter` is the port that stands for the one adapter under /dev/serial/by-id/.
    """
    asked = command.replace(_ADAPTER, adapter)
    for name in LAST_SESSION[0]:
        asked = asked.replace(name, LAST_SESSION[1])
    found = options(shlex.split(asked)[1:])
    bare = command.removeprefix("python -m serpent_twin.")
    fewer = next((change for start, change in SMALL if bare.startswith(start)), "")
    for name, values in options(shlex.split(fewer)).items():
        if name and (name in found or name not in ONLY_IN_PLACE):
            found[name] = values
    found.pop("--view", None)  # it opens a window
    return [word for name, values in found.items() for word in ([name] if name else []) + values]
