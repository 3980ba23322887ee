"""Compare what a trace found of the demo's robot with what is wrong with it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from experiments.demo import robot

_TOLERANCE, _NAMED = 0.2, 0.5
"""Relative error of a strength that still counts as right, and of one whose name alone does"""


@dataclass(frozen=True)
class PutIn:
    """Something that is wrong with the robot."""

    words: str
    effect: str
    """Name of the effect that a trace should find"""
    place: str
    """Name of its joint; empty where it concerns the whole robot"""
    strength: float
    """Strength in the unit of the effect's first parameter"""
    scale: float
    unit: str
    """Unit that people read, and the factor from the strength to it"""


FAULTS = (
    PutIn("all commands come late", "command_delay", "", robot.LATE, 1e3, "ms"),
    PutIn(f"friction at {robot.AT}", "hinge_friction", robot.AT, robot.FRICTION, 1.0, "N m"),
)


def verdict(found: Mapping[str, Any]) -> Iterator[str]:
    """A line for each fault, and for each effect that the trace found and the robot has not."""
    effects = list(found["effects"])
    for fault in FAULTS:
        match = next((e for e in effects if _is(e, fault)), None)
        truth = f"{fault.words}, {fault.scale * fault.strength:.3g} {fault.unit}"
        if match is None:
            yield f"  MISSED  {truth}: no such effect was found"
            continue
        effects.remove(match)
        size = next(iter(match["parameters"].values()))["value"]
        off = size / fault.strength - 1
        word = "right" if abs(off) <= _TOLERANCE else "named" if abs(off) <= _NAMED else "WRONG"
        apart = "" if word == "right" else f", {100 * off:+.0f} %".replace("-", "−")
        yield f"  {word}   {truth}: found {fault.scale * size:.3g} {fault.unit}{apart}"
    for each in effects:
        yield f"  WRONG   {each['name']} was found, which this robot does not have"


def _is(effect: Mapping[str, Any], fault: PutIn) -> bool:
    name, _, place = str(effect["name"]).partition("@")
    return name == fault.effect and (place == fault.place or not fault.place)
