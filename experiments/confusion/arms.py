"""Write the logs of arms with known faults, by the independent arm."""

import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import bench_arm
from experiments.arm_catalogue import CATALOGUE
from experiments.confusion.expected import of_bench
from experiments.confusion.plan import SESSIONS, Trial, confusable, plan
from serpent_twin.arm.geometry import ARM
from serpent_twin.effects import Effect, ranges, strengths
from serpent_twin.effects.strands import N_STRANDS
from serpent_twin.runs.files import write_json

RATE_HZ = 4.0
_VARIANTS = ("cable_friction_wrap", "link_twist")  # of effects that have other names
_NAMES = tuple(name for name in bench_arm.NAMES if name not in _VARIANTS)
KNOWN_EFFECTS = tuple(name for name in _NAMES if name in CATALOGUE)
OUTSIDE_EFFECTS = tuple(name for name in _NAMES if name not in CATALOGUE)
"""Effects of the independent arm that the catalogue has, and others"""
_UNITS = {"outside_force": "N"}  # of strengths that are no ratios
GENERATION, AS_BUILT, BY_FIT = 3, 2, 3
"""Generation of present studies; the first whose arms' links, axes and cameras are off, too; and the first
whose detection limits are what a fit cannot absorb, for the true values of an effect's other parameters:
before, they were stated to first order, for typical values
"""
Truth = dict[str, Any]
"""The truth of a recording: `effects`, each as from `truth_of`, and the arm."""


@dataclass(frozen=True)
class Length:
    """How much of each arm is recorded."""

    sessions: int
    steps: int
    """Control steps of each session, at 4 Hz"""


def truth_of(name: str, parameters: dict[str, float], strength: float) -> Truth:
    """The entry of an effect; `strong` names the parameters to be compared with their intervals."""
    kind = CATALOGUE.get(name)
    return {
        "name": name,
        "variant": _variant(kind, parameters) if kind else "",
        "parameters": {each: float(value) for each, value in parameters.items()},
        "strength": float(strength),
        "unit": next(iter(ranges(kind).values())).unit if kind else _UNITS.get(name, "1"),
        "strong": list(strengths(ranges(kind))) if kind else [],
    }


def _variant(kind: type[Effect], parameters: dict[str, float]) -> str:
    """Name of an effect's variant, if strengths of variants are not to be compared."""
    variants = kind.variants()
    if len({variant.strength for variant in variants}) == 1:
        return ""
    unlike = [n for n in ranges(kind) if len({getattr(variant, n) for variant in variants}) > 1]
    told = {n: parameters.get(n) for n in unlike if not ranges(kind)[n].fitted}
    return ", ".join(f"{n} {value:g}" for n, value in told.items() if value is not None)


def built(
    trial: Trial, length: Length, seed: int
) -> tuple[bench_arm.BenchArm, bench_arm.Effects, np.random.Generator]:
    """The bench arm of a trial with its effects, and what draws its sessions' seed."""
    rng = trial.rng(seed)
    arm, noise = bench_arm.draw(rng), rng.uniform(0.15e-3, 0.5e-3)
    arm = replace(arm, marker_noise=noise, load_noise=rng.uniform(0.004, 0.010))
    effects, seconds = bench_arm.NONE, length.sessions * length.steps / RATE_HZ
    for name, level in trial.effects:
        strength = level * bench_arm.TYPICAL[name]
        effects = bench_arm.inject(name, strength, rng, effects, seconds)
    return arm, effects, rng


def write_logs(trial: Trial, folder: Path, length: Length, seed: int) -> Truth:
    """Write an arm's sessions into a folder, unless they are complete there; returns what is true of it."""
    arm, effects, rng = built(trial, length, seed)
    marker = folder.with_name("recorded.json")
    if not (marker.exists() and folder.exists()):
        shutil.rmtree(folder, ignore_errors=True)  # of a run that was interrupted in here
        bench_arm.record(
            folder, arm, length.sessions, length.steps, int(rng.integers(1 << 31)), effects
        )
        folder.with_name(f"{folder.name}.truth.json").unlink(missing_ok=True)
        write_json(marker, {"sessions": length.sessions}, indent=None)
    told = [_told(name, effects) for name, _ in trial.effects]
    return {"effects": told, "parameters": asdict(arm)}


def _told(name: str, effects: Any) -> Truth:
    values = _values(name, effects) if name in CATALOGUE else {}
    return truth_of(name, values, effects.strength(name)) | {"answers": of_bench(name, effects)}


def _values(name: str, effects: Any) -> dict[str, float]:
    """What the bench arm injects, in the parameters of the catalogue's effect."""
    if name == "base_tilt":
        turn = effects.tilt_direction
        return {"about_y": effects.base_tilt * np.cos(turn),
                "about_z": effects.base_tilt * np.sin(turn)}  # fmt: skip
    first = next(iter(ranges(CATALOGUE[name])))
    more = {
        "cable_creep": {"time": effects.creep_time},
        "clamp_slip": {"grip": effects.clamp_threshold},
        "friction_warming": {"time": effects.warming_time},
        "link_flex": {"twist": effects.link_twist},
        "payload": {"place": _begins(effects.payload_link) + effects.payload_at},
    }
    where = {"strand": _strand(effects)} if effects.cable and name != "clamp_slip" else {}
    return {first: float(getattr(effects, name))} | more.get(name, {}) | where


def _strand(effects: Any) -> float:
    """The strands of the bench arm's one cable, as the catalogue's effects count them."""
    cable, side = effects.cable - 1, effects.side
    return float(2 * cable + (side < 0) if side else N_STRANDS + cable)


def _begins(link: int) -> float:
    """Where a link, from 1, begins on the straight arm, from the last joint [m]."""
    return float(-np.sum(ARM.link_length[link - 1 : -1]))


def planned(rounds: int, seed: int, sessions: Sequence[int] = (SESSIONS,)) -> list[Trial]:
    """The trials of a study with the arm's effects, in their order."""
    pairs = confusable(
        KNOWN_EFFECTS, {name: CATALOGUE[name].confused_with for name in KNOWN_EFFECTS}
    )
    return plan(KNOWN_EFFECTS, OUTSIDE_EFFECTS, pairs, rounds, seed, sessions)
