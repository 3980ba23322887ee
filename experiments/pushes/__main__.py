"""Measure how pulses of torque on a real machine are felt, and what is felt without any.

Traces logs of a double pendulum that nothing pushes, then estimates the external torque at both joints in a
log with pulses, by the nominal twin and by the corrected one.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from experiments.measured.benchmark import BENCHMARKS
from experiments.pushes.logged import FREE, PUSHED, Recorded, recorded
from experiments.pushes.score import drawn, scored
from experiments.result_page import publish, store, write_report
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.estimators.external_torque import external_torques
from serpent_twin.identification import Trace
from serpent_twin.identification.discovery import with_laws
from serpent_twin.identification.run import trace_sessions
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import ModelRig, open_machine
from serpent_twin.machines.model.held_motion import with_smoothed
from serpent_twin.machines.model.twin_file import read_twin
from serpent_twin.stored import within

MACHINE = Path(__file__).parents[1] / "measured" / PUSHED / "machine.toml"


@dataclass(frozen=True)
class Pushes(Checked):
    """Feel pulses of torque by the twin of a double pendulum, and compare them with what was logged."""

    data: Path
    """Folder with the folders dfki_double_pendulum_c and dfki_perturbed of logs."""
    out: Path = Path("pushes")
    """Folder for results; the same command goes on where it stopped."""
    shortest: tuple[Annotated[float, within(0.02, 10.0, "s")], ...] = (0.17, 0.1, 0.25)
    """Duration of the shortest push to be felt. Motion and torques are filtered below one cycle in it; the
    first one is drawn. The logged pulses last 0.17 s at half their height."""
    alarms_per_minute: Annotated[float, within(1e-6, 100.0)] = 1.0
    """False alarms that Gaussian noise would cause at each joint, which set the thresholds."""
    seed: Seed = 0
    """Seed of bootstrap and permutations."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/pushes.md."""


def main(config: Pushes) -> None:  # noqa: D103 tyro would print it above the config's own
    config.out.mkdir(parents=True, exist_ok=True)
    rig = open_machine(MACHINE)
    logs = recorded(rig, config.data)
    found = [_felt(config, rig, logs, each) for each in config.shortest]
    settings = {"alarms_per_minute": config.alarms_per_minute, "seed": config.seed}
    for each in found[1:]:
        del each["drawn"]
    figures = {"durations": found, "settings": settings}
    results = store(config.out / "results.json", "experiments.pushes", figures)
    print(write_report(results, config.out))
    publish(results, config.page)


def _felt(config: Pushes, rig: ModelRig, logs: Recorded, shortest: float) -> dict[str, Any]:
    """What the nominal and the corrected twin feel of pushes that last so long [s] at least."""
    hz, out = 1 / shortest, config.out / f"{1e3 * shortest:.0f}_ms"
    every = [*logs.training, *logs.judging, *logs.pushed]
    smooth = with_smoothed(rig.described, every[: -len(logs.pushed)], hz)
    training, judging = smooth[: len(logs.training)], smooth[len(logs.training) :]
    judge = ", ".join(BENCHMARKS[FREE].splits[0])
    wanted = Trace((config.data / FREE,), out, rig=rig.name, seed=config.seed, judge=judge)
    _, numbers = trace_sessions(wanted, rig, training, judging)
    corrected = read_twin(out / "twin.json", rig.name).point
    case = with_laws(rig.open(training), corrected.effects)
    twins = {"nominal": ParameterVector.nominal(case.declared), "corrected": corrected}
    torques = {name: external_torques(rig, case, twin, every, hz) for name, twin in twins.items()}
    return {
        "shortest_s": shortest,
        "effects": [each["name"] for each in numbers["effects"]],
        "twins": {
            name: scored(logs, of, hz, config.alarms_per_minute) for name, of in torques.items()
        },
        "drawn": drawn(logs.pushed[0], torques["corrected"][-len(logs.pushed)]),
    }


if __name__ == "__main__":
    cli.run(main)
