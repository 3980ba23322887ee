"""Fit the twin's free parameters to the paper's results table.

The only published measurement of the real arm is five mean marker errors. Two stages: many short
runs of the twin over the plausible ranges teach an emulator how each error changes with the
parameters; then full runs, 23 sessions × 2,100 steps and every readout as published, each where the
emulator expects the paper's errors judging from the best full run so far. Every run is stored when
it is done, and none is made twice: called as it is, this prints the fit that the nominal parameters
come from.
"""

import tempfile
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import qmc

from experiments.paper_table.result_page import error_table, sensitivity_table
from experiments.result_page import publish, store
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import GIVEN, Checked, Seed, when
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.runs.files import json_text
from serpent_twin.runs.provenance import git_commit
from serpent_twin.runs.report import text_table
from serpent_twin.stored import read_json_lines, within
from serpent_twin.training.train import Train, train

PAPER_MM = {"analytical": 39.5, "no_load": 5.1, "linear": 7.2, "mlp": 4.3, "lstm": 4.4}
PAPER_STD_MM = {"analytical": 23.9, "no_load": 4.3, "linear": 7.0, "mlp": 3.6, "lstm": 3.6}

RANGES = {
    "strand_stiffness": (5e3, 3e4),
    "strand_slack": (3e-4, 1.5e-3),
    "joint_friction": (1e-3, 1e-2),
    "joint_damping": (5e-4, 5e-3),
    "gear_friction": (5e-3, 4e-2),
    "controller_gain": (1.2, 2.5),
    "marker_noise": (2e-4, 1e-3),
    "load_noise": (2e-3, 1.5e-2),
}
"""What is plausible: 0.4 mm braided polyethylene over 0.1 … 0.6 m gives 5 … 30 kN/m without clamps
and printed pulleys; markers and loads are no better than their sensors."""


@dataclass(frozen=True)
class PaperTable(Checked):
    """Fit the nominal parameters to the paper's results table, or check those in force."""

    out: Path = Path(__file__).parent
    """Folder of the runs and the result; another one starts the fit again."""
    design: Annotated[int, within(0, 10_000)] = 8
    """Short runs at least that teach the emulator; 0 to judge the nominal parameters only."""
    full: Annotated[int, within(1, 10_000), when(design=GIVEN)] = 4
    """Full runs at most; the first that is within --close ends the fit."""
    close: Annotated[float, within(1e-6, 10), when(design=GIVEN)] = 0.15
    """Largest relative error of a mean that is good enough."""
    seed: Seed = 0
    """Seed of the design and of every run."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/paper-table.md."""


FULL = {"sessions": 23, "steps": 2100}
SHORT = {"sessions": 10, "steps": 1100}
SHORT_TRAINING = {
    "epochs": 14,
    "validate": ("session_07", "session_08"),
    "test": ("session_09", "session_10"),
}
EMULATED = [name for name in PAPER_MM if name != "lstm"]
"""What short runs train; the LSTM is slow."""
FULL_TO_SHORT = {"analytical": 1.0, "no_load": 0.75, "linear": 0.95, "mlp": 0.7}
"""First guess of how a full run's errors compare to a short one's; full runs replace it."""


def measure(folder: Path, parameters: Parameters, seed: int, full: bool) -> dict:
    """Collect sessions in a folder and train readouts on them; their scores by name."""
    size, how = (FULL, {}) if full else (SHORT, SHORT_TRAINING)
    collect(Collect(folder / "logs", seed=seed, parameters=parameters, **size))
    names = tuple(PAPER_MM) if full else tuple(EMULATED)
    scores = train(Train(folder / "logs", folder / "readouts", names, seed=seed, **how))
    kept = ("mean_mm", "std_mm", "std_of_step_means_mm")
    return {n: {key: scores["readouts"][n][key] for key in kept} for n in names}


def run(config: PaperTable, parameters: Parameters, full: bool) -> dict:
    """One run of the twin at some parameters, from the store if it was made before."""
    key = {"full": full, "seed": config.seed} | asdict(parameters)
    for known in stored(config):
        if known["key"] == key:
            return known["errors"]
    with tempfile.TemporaryDirectory() as folder:
        errors = measure(Path(folder), parameters, config.seed, full)
    with (config.out / "runs.jsonl").open("a") as file:
        today = datetime.now(UTC).date().isoformat()
        made = {"key": key, "errors": errors, "git_commit": git_commit(), "date": today}
        file.write(json_text(made, indent=None))
    print("full " if full else "short", _line(errors), flush=True)
    return errors


def stored(config: PaperTable) -> list[dict]:
    """All runs made so far, each its key and its errors; earlier ones know not all of today's parameters."""
    path = config.out / "runs.jsonl"
    runs = read_json_lines(path) if path.exists() else []
    return [run | {"key": asdict(Parameters()) | run["key"]} for run in runs]


def short_runs(config: PaperTable) -> tuple[NDArray, NDArray]:
    """Places, (n, 8), and mean errors [mm], (n, readouts), of all short runs made so far."""
    found = [r for r in stored(config) if not r["key"]["full"] and r["key"]["seed"] == config.seed]
    free = [{n: v for n, v in r["key"].items() if n not in ("full", "seed")} for r in found]
    errors = [[r["errors"][n]["mean_mm"] for n in EMULATED] for r in found]
    return np.array([place(Parameters(**p)) for p in free]), np.array(errors)


def _line(errors: dict) -> str:
    return "  ".join(f"{name} {e['mean_mm']:.2f}" for name, e in errors.items())


def place(parameters: Parameters) -> NDArray[np.float64]:
    """Parameters as a point in the unit cube of the ranges' logarithms, (8,)."""
    low, high = np.log(np.array(list(RANGES.values()))).T
    return (np.log([getattr(parameters, name) for name in RANGES]) - low) / (high - low)


def parameters_at(point: NDArray[np.float64]) -> Parameters:
    """The parameters at a point of the unit cube, to three digits."""
    low, high = np.log(np.array(list(RANGES.values()))).T
    values = np.exp(low + point * (high - low))
    return replace(NOMINAL, **{n: float(f"{v:.3g}") for n, v in zip(RANGES, values, strict=True)})


def features(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Constant, linear and quadratic terms of points, (n, 8) -> (n, 45)."""
    x = np.atleast_2d(points) - 0.5
    i, j = np.triu_indices(x.shape[1])
    return np.concatenate([np.ones((len(x), 1)), x, x[:, i] * x[:, j]], axis=1)


def emulate(
    points: NDArray[np.float64], errors: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Ridge weights, (45, readouts), of the log errors, and their leave-one-out error."""
    phi, y = features(points), np.log(errors)
    penalty = np.diag([0.0] + [1.0] * 8 + [4.0] * 36)

    def solve(strength: float) -> tuple[float, NDArray[np.float64]]:
        inverse = np.linalg.inv(phi.T @ phi + strength * penalty)
        weights = inverse @ phi.T @ y
        leverage = np.einsum("ij,jk,ik->i", phi, inverse, phi)
        return float((((y - phi @ weights) / (1 - leverage)[:, None]) ** 2).mean()), weights

    loss, weights = min((solve(s) for s in np.logspace(-3, 1, 17)), key=lambda found: found[0])
    return weights, float(np.sqrt(loss))


NOISE = list(RANGES).index("marker_noise")
MOST_MARKER_NOISE = 1.4e-3
"""Largest noise of each coordinate [m]: cameras, and markers that wobble on printed links."""
REACH = 0.15
"""How far from a full run, as a share of a range's logarithm, the emulator is trusted."""


def expected(
    step: NDArray[np.float64], noise: float, anchor: dict, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Errors of a full run [mm], (5,), a step away from one that was made, at a marker noise [m].

    The emulator gives the factor by which each error changes; LSTM is taken to change as MLP does. White
    noise of the measured markers is not emulated: it adds to any estimate's error in quadrature.
    """
    here = place(Parameters(**anchor["parameters"]))
    change = (features(here + step) - features(here))[0] @ weights
    factor = dict(zip(EMULATED, np.exp(change), strict=True))
    factor["lstm"] = factor["mlp"]
    error = np.array([anchor["errors"][n]["mean_mm"] * factor[n] for n in PAPER_MM])
    mean_norm = 2 * np.sqrt(2 / np.pi) * 1e3  # of three unit normal coordinates, in mm
    more = noise**2 - anchor["parameters"]["marker_noise"] ** 2
    return np.sqrt(np.maximum(error**2 + mean_norm**2 * more, 1e-2))


def next_point(anchor: dict, weights: NDArray[np.float64]) -> Parameters:
    """Where the paper's errors are expected, within reach of a full run that was made."""
    here = place(Parameters(**anchor["parameters"]))
    paper = np.array(list(PAPER_MM.values()))

    def loss(x: NDArray[np.float64]) -> float:
        step = np.insert(x[:-1], NOISE, 0.0)
        miss = np.log(expected(step, x[-1] * 1e-3, anchor, weights) / paper)
        return float((miss**2).sum() + 0.02 * (x[:-1] ** 2).sum())

    free = np.delete(here, NOISE)
    bounds = [(-min(REACH, at), min(REACH, 1 - at)) for at in free]
    bounds += [(0.2, MOST_MARKER_NOISE * 1e3)]
    low, high = np.array(bounds).T
    starts = low + qmc.Sobol(len(bounds), seed=1).random(32) * (high - low)
    found = min((minimize(loss, s, bounds=bounds) for s in starts), key=lambda one: one.fun).x
    moved = parameters_at(here + np.insert(found[:-1], NOISE, 0.0))
    return replace(moved, marker_noise=float(f"{found[-1] * 1e-3:.3g}"))


def full_runs(config: PaperTable) -> list[dict]:
    """Parameters and errors of all full runs made so far, the one nearest to the paper first."""
    found = [r for r in stored(config) if r["key"]["full"] and r["key"]["seed"] == config.seed]
    runs = [
        {
            "parameters": {n: r["key"][n] for n in asdict(NOMINAL)},
            "errors": r["errors"],
            "run": {"git_commit": r.get("git_commit"), "date": r.get("date")},
        }
        for r in found
    ]
    return sorted(runs, key=lambda one: worst(one["errors"]))


def fit(config: PaperTable) -> dict:
    """Parameters and errors of the full run that misses the paper least."""
    for point in qmc.Sobol(len(RANGES), seed=config.seed).random(config.design):
        run(config, parameters_at(point), full=False)
    points, errors = short_runs(config)
    weights, _ = emulate(points, errors)
    if not full_runs(config):
        goal = np.array([PAPER_MM[name] / FULL_TO_SHORT[name] for name in EMULATED])
        nearest = np.argmin((np.log(errors / goal) ** 2).sum(axis=1))
        run(config, parameters_at(points[nearest]), full=True)
    while worst((best := full_runs(config)[0])["errors"]) > config.close:
        if len(full_runs(config)) >= config.full:
            break
        run(config, next_point(best, weights), full=True)
    return best


def worst(errors: dict) -> float:
    """Largest relative distance of a mean from the paper's."""
    return max(abs(errors[name]["mean_mm"] / mm - 1) for name, mm in PAPER_MM.items())


def sensitivity(config: PaperTable) -> dict[str, Any]:
    """Relative change of each error from a parameter's lower to its upper bound, with the others midway."""
    points, errors = short_runs(config)
    weights, left_out = emulate(points, errors)
    changes = {
        name: dict(zip(EMULATED, np.expm1(row).tolist(), strict=True))
        for name, row in zip(RANGES, weights[1:9], strict=True)
    }
    return {"short_runs": len(points), "leave_one_out_error": left_out, "change": changes}


def main(config: PaperTable) -> None:
    """Fit, print the tables, and write results.json beside the runs."""
    config.out.mkdir(parents=True, exist_ok=True)
    nominal = {"parameters": asdict(NOMINAL), "errors": {}}
    found = fit(config) if config.design else nominal | {"errors": run(config, NOMINAL, full=True)}
    names = ("design", "full", "close", "seed")
    figures = found | {
        "paper_mm": PAPER_MM,
        "paper_std_mm": PAPER_STD_MM,
        "ranges": RANGES,
        "sensitivity": sensitivity(config) if config.design else None,
        "full_size": FULL,
        "short_size": SHORT | {"epochs": SHORT_TRAINING["epochs"]},
        "settings": {name: getattr(config, name) for name in names},
    }
    results = store(config.out / "results.json", "experiments.paper_table", figures)
    print(f"\n{text_table(error_table(results))}")
    if results["sensitivity"]:
        print(f"\n{text_table(sensitivity_table(results))}")
    print(f"\nParameters: {found['parameters']}")
    publish(results, config.page)


if __name__ == "__main__":
    cli.run(main)
