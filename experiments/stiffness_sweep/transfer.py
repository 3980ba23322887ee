"""Score a readout of one arm on another."""

from collections.abc import Mapping, Sequence
from typing import Any

from tqdm import tqdm

from experiments.stiffness_sweep.arms import trained
from experiments.stiffness_sweep.plan import SweepPlan
from serpent_twin.errors import SerpentError
from serpent_twin.readouts.score import score
from serpent_twin.readouts.windows import SessionWindows, cut
from serpent_twin.reservoir import pose
from serpent_twin.reservoir.grid_point import DROP, WINDOW
from serpent_twin.sessions import Session

READOUTS = ("linear", "residual")
_MOST = 4  # twins


def matrix(plan: SweepPlan, logs: Mapping[str, Sequence[Session]]) -> dict[str, Any]:
    """Mean marker distances [mm] by readout, arm that trained, arm that tests."""
    arms = {**_twins(plan), **logs}
    tests = {name: cut([of[-1]], WINDOW, DROP).sessions[0] for name, of in arms.items()}
    found = {
        readout: {name: _tested(readout, of, tests) for name, of in arms.items()}
        for readout in READOUTS
    }
    return {"arms": list(arms), "mm": found}


def _tested(
    readout: str, sessions: Sequence[Session], tests: Mapping[str, SessionWindows]
) -> dict[str, float]:
    learned = trained(readout, sessions)
    return {
        name: score(learned.follow(test).marker, test.marker).mean_mm
        for name, test in tests.items()
    }


def _twins(plan: SweepPlan) -> dict[str, list[Session]]:
    """Sessions of twins from soft to stiff, by name; those that become unstable are left out."""
    step = -(-len(plan.stiffness) // _MOST)
    found, numbers = {}, range(1, plan.measuring.sessions + 1)
    for stiffness in tqdm(plan.stiffness[::step], unit="twin", desc="transfer"):
        point = plan.point(stiffness)
        try:
            sessions = [pose.session(point, plan.measuring, n) for n in numbers]
        except SerpentError:
            continue
        found[f"{stiffness / 1e3:.3g} kN/m"] = sessions
    return found


def worst(found: Mapping[str, Any]) -> str:
    """How much a readout loses on another arm, in a sentence."""
    told = []
    for readout, mm in found["mm"].items():
        own = [mm[name][name] for name in found["arms"]]
        other = [mm[a][b] for a in found["arms"] for b in found["arms"] if a != b]
        mean = sum(own) / len(own), sum(other) / len(other)
        told.append(
            f"{readout} {mean[0]:.1f} mm on the arm that trained it, {mean[1]:.1f} on others"
        )
    return f"Mean over arms: {'; '.join(told)}."
