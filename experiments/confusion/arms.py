"""Write the logs of arms with known faults, by the twin or by the independent arm."""

import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

import bench_arm
from experiments.confusion.expected import of_bench, of_twin
from experiments.confusion.outside import OUTSIDE, place
from experiments.confusion.plan import SESSIONS, Trial, confusable, plan
from serpent_twin.arm.control import random_targets
from serpent_twin.arm.deviations import EXACT, GEOMETRY, Deviations
from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.effects import Effect, by_name, ranges, strengths
from serpent_twin.effects.strands import N_STRANDS
from serpent_twin.machines.arm.catalogue import CATALOGUE
from serpent_twin.recording.simulated_arm import SimulatedArm
from serpent_twin.runs.files import write_json
from serpent_twin.sessions import Session, write_session
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import TwinModel

RATE_HZ = 4.0
MARKER_LOSS = 0.002
GENERATION, AS_BUILT, BY_FIT = 3, 2, 3
"""Of the studies; the first whose arms' links, axes and cameras are off, too; and the first whose detection
limits are what a fit cannot take up, for the true values of an effect's other parameters: before, they were
stated to first order, for typical values
"""
Truth = dict[str, Any]
"""The truth of a recording: `effects`, each as from `_truth`, and the arm."""


@dataclass(frozen=True)
class Length:
    """How much of each arm is recorded."""

    sessions: int
    steps: int
    """Control steps of each session, at 4 Hz"""


class LogSource(Protocol):
    """Where the logs come from."""

    known: tuple[str, ...]
    """Effects of the catalogue that it can have"""
    outside: tuple[str, ...]
    """Others"""

    def write(self, trial: Trial, folder: Path, length: Length, seed: int) -> Truth:
        """Write an arm's sessions into a folder; what is complete there is kept."""
        ...


class TwinSource:
    """Arms that are the twin, with other numbers: easier than a real arm."""

    known = tuple(CATALOGUE)
    outside = tuple(OUTSIDE)

    def write(self, trial: Trial, folder: Path, length: Length, seed: int) -> Truth:
        """Simulate the sessions one after the other."""
        rng = trial.rng(seed)
        built = replace(draw(rng), effects=tuple(injected(*e, rng) for e in trial.effects))
        folder.mkdir(parents=True, exist_ok=True)
        for number in range(1, length.sessions + 1):
            path = folder / f"session_{number:02d}.parquet"
            if not path.exists():
                for_session = np.random.default_rng([seed, number, *trial.id.encode()])
                write_session(path, simulated(built, number, length.steps, for_session))
        names = [name for name, _ in trial.effects]
        told = [_told(n, e) for n, e in zip(names, built.effects, strict=True)]
        return {"effects": told, "parameters": asdict(built.parameters)}


def simulated(built: TwinModel, number: int, steps: int, rng: np.random.Generator) -> Session:
    """One session of a twin behind its simulated bus and cameras."""
    for_targets, for_loads, for_cameras = rng.spawn(3)
    twin = Twin(built, prior_runtime=(number - 1) * steps / RATE_HZ)
    arm = SimulatedArm.of(twin, built.parameters, for_loads, for_cameras, MARKER_LOSS)
    about = {"backend": "sim", "arm": "confusion", "session": number}
    return arm.session(random_targets(steps, for_targets), RATE_HZ, about)


def draw(rng: np.random.Generator) -> TwinModel:
    """An arm as workshops build them: other numbers than the nominal, each part a little different."""

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    parameters = Parameters(
        strand_stiffness=between(5e3, 25e3),
        strand_slack=between(0.2e-3, 0.7e-3),
        joint_friction=between(2e-3, 8e-3),
        transition_velocity=between(5e-3, 6e-2),
        joint_damping=between(1e-3, 2e-2),
        gear_friction=between(0.02, 0.08),
        controller_gain=NOMINAL.controller_gain,
        marker_noise=rng.uniform(0.15e-3, 0.5e-3),
        load_noise=rng.uniform(0.004, 0.010),
    )
    spread = {
        "strand_stiffness": 0.08,
        "strand_slack": 0.1 * parameters.strand_slack,
        "joint_friction": 0.08,
        "transition_velocity": 0.2,
        "jaw_friction": 0.5,
        "jaw_held": 0.0,
        "joint_damping": 0.08,
        "winch_radius": 0.003,
        "gear_friction": 0.08,
        "marker": 0.3e-3,
        "link_length": 0.02,
        "link_mass": 0.03,
        "axis_tilt": 5e-3,
        "camera_pose": np.repeat([1.5e-3, 3e-3], 3),
    }
    shape, jaw = rng.spawn(2)  # so that seeds give the cables that they gave before
    of = {name: shape if name in GEOMETRY else rng for name in spread} | {"jaw_friction": jaw}
    each = {f.name: spread[f.name] * of[f.name].standard_normal(len(getattr(EXACT, f.name)))
            for f in fields(Deviations)}  # fmt: skip
    return TwinModel(parameters, Deviations(**{n: tuple(v.tolist()) for n, v in each.items()}))


def injected(name: str, level: float, rng: np.random.Generator) -> Effect:
    """An effect at a level, in typical strengths; all else that it has is drawn."""
    if name in OUTSIDE:
        kind = OUTSIDE[name]
        first, allowed = next(iter(ranges(kind).items()))
        return kind(**{first: min(level * allowed.typical, allowed.high)}, **place(name, rng))
    kind = by_name(name)
    variants = kind.variants()
    usual = variants[int(rng.integers(len(variants)))]
    values = {each: float(getattr(usual, each)) for each in ranges(kind)}
    strong = strengths(ranges(kind))
    turn = rng.standard_normal(len(strong)) if len(strong) > 1 else np.ones(1)
    turn /= np.linalg.norm(turn)
    for each, share in zip(strong, turn, strict=True):
        signed = float(share) if ranges(kind)[each].low < 0 else abs(float(share))
        values[each] = level * usual.strength * signed
    for each, allowed in ranges(kind).items():
        if allowed.fitted and each not in strong and allowed.low >= 0:
            values[each] *= float(np.exp(rng.uniform(-0.5, 0.5)))
        values[each] = float(np.clip(values[each], allowed.low, allowed.high))
    return kind(**values)


def _told(name: str, effect: Effect) -> Truth:
    values = {each: float(getattr(effect, each)) for each in ranges(type(effect))}
    return _truth(name, values, effect.strength) | {"answers": of_twin(name, values)}


def _truth(name: str, parameters: dict[str, float], strength: float) -> Truth:
    """The entry of an effect; `strong` names the parameters to be compared with their intervals."""
    kind = CATALOGUE.get(name) or OUTSIDE.get(name)
    known = kind is not None and name in CATALOGUE
    return {
        "name": name,
        "variant": _variant(kind, parameters) if kind and known else "",
        "parameters": parameters,
        "strength": strength,
        "unit": next(iter(ranges(kind).values())).unit if kind else "1",
        "strong": list(strengths(ranges(kind))) if kind and known else [],
    }


def _variant(kind: type[Effect], parameters: dict[str, float]) -> str:
    """Which of an effect's variants it is, if their strengths are not to be compared."""
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


class BenchSource:
    """The independent arm: no physics shared with the twin."""

    def __init__(self) -> None:
        variants = ("cable_friction_wrap", "link_twist")  # of effects that have other names
        names = [n for n in bench_arm.NAMES if n not in variants]
        self.known = tuple(n for n in names if n in CATALOGUE)
        self.outside = tuple(n for n in names if n not in CATALOGUE)

    def write(self, trial: Trial, folder: Path, length: Length, seed: int) -> Truth:
        """Simulate all sessions at once."""
        arm, effects, rng = built(trial, length, seed)
        marker = folder.with_name("recorded.json")
        if not (marker.exists() and folder.exists()):
            shutil.rmtree(folder, ignore_errors=True)  # of a run that was interrupted in here
            bench_arm.record(
                folder, arm, length.sessions, length.steps, int(rng.integers(1 << 31)), effects
            )
            folder.with_name(f"{folder.name}.truth.json").unlink(missing_ok=True)
            write_json(marker, {"sessions": length.sessions}, indent=None)
        told = [_bench_told(name, effects) for name, _ in trial.effects]
        return {"effects": told, "parameters": asdict(arm)}


def _bench_told(name: str, effects: Any) -> Truth:
    values = _bench_values(name, effects) if name in CATALOGUE else {}
    return _truth(name, values, effects.strength(name)) | {"answers": of_bench(name, effects)}


def _bench_values(name: str, effects: Any) -> dict[str, float]:
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


SOURCES: dict[str, type[TwinSource] | type[BenchSource]] = {
    "twin": TwinSource,
    "bench": BenchSource,
}


def planned(
    source: str, rounds: int, seed: int, sessions: Sequence[int] = (SESSIONS,)
) -> list[Trial]:
    """The trials of a study with a source's effects, in their order."""
    of = SOURCES[source]()
    pairs = confusable(of.known, {name: CATALOGUE[name].confused_with for name in of.known})
    return plan(of.known, of.outside, pairs, rounds, seed, sessions)
