"""Train pose readouts on session logs and score them: `python -m serpent_twin.train`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.training.train import Train, TrainingPlan, carried_out, planned, train

__all__ = ["Train", "train"]

ALIKE = 1.05
"""Times the least error, up to which a readout is as good as the best"""


def main(config: Train) -> None:
    plan = planned(config)
    scores = carried_out(plan)
    if note := without_observer(plan):
        print(note)
    next_step.say(after_training(plan, scores))


def after_training(plan: TrainingPlan, scores: Mapping[str, Any]) -> next_step.Words:
    """Trace an arm whose twin has not been fitted, else follow it by the best readout."""
    if not plan.twin.settled and not plan.adaptation:
        return _trace_of(plan)
    out, rate = plan.config.out, plan.sessions.test[0].rate_hz
    model = best_readout(out, scores)
    return next_step.step("estimate", model=model, rate=rate, out=out.parent / "live")


def without_observer(plan: TrainingPlan) -> str:
    """Why the observer was not trained, and what trains it; nothing if it was, or others were asked for."""
    if plan.twin.design or plan.config.readout:
        return ""
    tracing, out = _trace_of(plan), plan.config.out
    twin, out = Path(tracing[-1]) / "twin.json", out.with_name(f"{out.name}_with_twin")
    again = next_step.step("train", logs=plan.config.logs, twin=twin, out=out)
    return (
        "The observer, which simulates the arm, was not trained: the twin of this arm is not known. "
        f"To train it: {next_step.typed(tracing)}, then {next_step.typed(again)}"
    )


def best_readout(out: Path, scores: Mapping[str, Any]) -> Path:
    """The readout of the least error, of several as good the quickest; if an arm was adapted to, on it."""
    found = {out / "models" / n: each for n, each in scores["readouts"].items()}
    for name, of in (scores.get("adapt") or {"windows": {}})["windows"].items():
        for count, each in of.items():
            place = out / "models" / name if count == "0" else out / "adapted" / count / name
            found[place] = each
    alike = ALIKE * min(each["mean_mm"] for each in found.values())
    return min(found, key=lambda p: (max(alike, found[p]["mean_mm"]), found[p]["latency_ms"]))


def _trace_of(plan: TrainingPlan) -> next_step.Words:
    """A trace of the logs that were trained on."""
    logs, beside = plan.config.logs, plan.config.out.parent
    out = next_step.named_after(beside, logs, "logs", "trace")
    return next_step.step("trace", logs=logs, out=out)


if __name__ == "__main__":
    cli.run(main)
