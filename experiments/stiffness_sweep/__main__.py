"""Measure how the stiffness of its cables changes an arm's memory, computation, and the error of its pose.

Sweeps twins over stiffness and slack, and, in less detail, over commands, damping and gravity; answers
what was expected of them with numbers; and places logged arms on the chart.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from tqdm import tqdm

from experiments.close_the_loop.__main__ import LOGS, arm_folders, session_hashes
from experiments.result_page import publish, store, write_report
from experiments.stiffness_sweep.answers import answers
from experiments.stiffness_sweep.arms import place, placed
from experiments.stiffness_sweep.engine import engine_ratio, seconds_per_point
from experiments.stiffness_sweep.networks import added, networks
from experiments.stiffness_sweep.plan import GRID, POSED, SweepPlan, full, quick
from experiments.stiffness_sweep.result_page import reasons
from experiments.stiffness_sweep.rows import rows_of
from experiments.stiffness_sweep.transfer import matrix
from serpent_twin import stored
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import GIVEN, Checked, RateHz, Workers, used_only, when
from serpent_twin.reservoir.sweep_rows import SweepRow
from serpent_twin.reservoir.sweep_run import Sweep, sweep
from serpent_twin.runs.files import write_json
from serpent_twin.runs.provenance import file_hash
from serpent_twin.runs.run_lock import claimed
from serpent_twin.sessions import Session, read_folder, refuse_damaged
from serpent_twin.stored import within

SETTINGS = "stiffness_sweep.json"


@dataclass(frozen=True)
class StiffnessSweep(Checked):
    """Sweep the cables' stiffness, answer what was expected, and place logged arms on the chart."""

    out: Path = Path("stiffness_sweep")
    """Folder for results; the same command goes on where it stopped."""
    quick: bool = False
    """A few short points: a minute or two, to see that everything works; it shows little else."""
    rate: Annotated[RateHz, when(quick=False)] = 2.5
    """Commands per second [Hz]; slower ones go further, and take longer. --quick has the published 4."""
    lstm: Annotated[bool, when(quick=False)] = False
    """Train the published LSTM, too, at one slack; it takes minutes a point."""
    logs: Path | None = LOGS
    """Folder of folders, one per arm, or one arm's folder of session logs; None for no arm."""
    arms: Annotated[tuple[str, ...], when(logs=GIVEN)] = ()
    """Which arms, by the names of their folders; all without."""
    sessions: Annotated[int, within(0, 10_000), when(logs=GIVEN)] = 0
    """Use only this many sessions of each arm, the first ones; 0 for all."""
    twins: Annotated[Path | None, when(logs=GIVEN)] = None
    """Folder with ARM/twin.json of traced arms; without, stiffness is a first guess from the logs."""
    transfer: bool = True
    """Test readouts trained on one arm on every other."""
    workers: Workers = 0
    """Processes side by side; 0 for one a core."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/stiffness-sweep.md."""


def main(config: StiffnessSweep) -> None:  # noqa: D103 tyro would print it above the config's own
    plan = quick() if config.quick else full(config.rate, ("lstm",) if config.lstm else ())
    folders = arm_folders(config.logs, config.arms) if config.logs else {}
    twins = {name: twin for name in folders if (twin := _twin(config, name))}
    about = settings(config, plan, folders, twins)
    with claimed(config.out, SETTINGS, about):
        rows, costs = measured(config, plan)
        ratio = _kept(config.out / "engine.json", lambda: engine(plan))["ratio"]
        logs = {name: read(config, plan, folder) for name, folder in folders.items()}
        arms = {name: arm(config, plan, name, of, twins.get(name)) for name, of in logs.items()}
        crossed = None
        if config.transfer:
            crossed = _kept(config.out / "transfer.json", lambda: matrix(plan, logs))
        found = answers(rows)
        figures = {
            "points": len(costs),
            "seconds_per_point": seconds_per_point(costs),
            "engine_ratio": ratio,
            "table": [row.numbers() for row in rows[GRID]],
            "besides": {k: [r.numbers() for r in of] for k, of in rows.items() if k != GRID},
            "answers": [answer.stored() for answer in found],
            "arms": arms,
            "transfer": crossed,
            "quick": config.quick,
            "settings": about,
        }
        results = store(config.out / "results.json", "experiments.stiffness_sweep", figures)
        written = write_report(results, config.out)
    publish(results, config.page)
    print(f"{reasons(found)}\n{written}")


def measured(
    config: StiffnessSweep, plan: SweepPlan
) -> tuple[dict[str, list[SweepRow]], list[dict[str, Any]]]:
    """All points of a plan, and what each took; what is there is not measured again."""
    named = plan.points()
    posed = list(dict.fromkeys(point for name in POSED for point in named[name]))
    others = list(
        dict.fromkeys(point for of in named.values() for point in of if point not in posed)
    )
    parts = {"sweep": (posed, used_only(plan.measuring)),
             "commands": (others, used_only(replace(plan.measuring, readouts=())))}  # fmt: skip
    found, costs = {}, []
    for name, (points, measuring) in parts.items():
        out = config.out / name
        asked = Sweep(out, steps=plan.steps, workers=config.workers, measuring=measuring)
        table = sweep(asked, points)["points"]
        found |= dict(zip(points, table, strict=True))
        costs += [stored.read_json(out / "provenance" / each["file"]) for each in table]
    rows = rows_of(named, found, plan.measuring)
    rows[GRID] = added(
        rows[GRID], named[GRID], networks(plan, config.out / "networks", config.workers)
    )
    return rows, costs


def engine(plan: SweepPlan) -> dict[str, float]:
    """The sweep's simulation against MuJoCo alone, on a short point of the nominal stiffness."""
    return {"ratio": engine_ratio(plan.point(NOMINAL.strand_stiffness))}


def read(config: StiffnessSweep, plan: SweepPlan, folder: Path) -> list[Session]:
    """The sessions of an arm that are to be used."""
    sessions = read_folder(folder)[: config.sessions or None]
    refuse_damaged(sessions)
    return [session[: plan.log_rows] for session in sessions]


def arm(
    config: StiffnessSweep,
    plan: SweepPlan,
    name: str,
    sessions: Sequence[Session],
    twin: Path | None,
) -> dict[str, Any]:
    """What is found of a logged arm."""
    folder = config.out / "arms"
    folder.mkdir(exist_ok=True)
    tqdm.write(f"{name}: its place, and the twin there")
    return _kept(folder / f"{name}.json", lambda: placed(sessions, place(sessions, twin), plan))


def settings(
    config: StiffnessSweep, plan: SweepPlan, folders: Mapping[str, Path], twins: Mapping[str, Path]
) -> dict[str, Any]:
    """What the results depend on."""
    return {
        "plan": asdict(plan),
        "input_sha256": session_hashes(folders, config.sessions),
        "twins_sha256": {name: file_hash(path) for name, path in twins.items()},
        "transfer": config.transfer,
    }


def _twin(config: StiffnessSweep, name: str) -> Path | None:
    path = config.twins / name / "twin.json" if config.twins else None
    return path if path and path.exists() else None


def _kept(path: Path, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What a file holds, made first if it is not there."""
    if not path.exists():
        write_json(path, make())
    return stored.read_json(path)


if __name__ == "__main__":
    cli.run(main)
