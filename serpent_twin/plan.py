"""Plan the motion that decides what a trace left open: `python -m serpent_twin.plan`."""

from pathlib import Path

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.recording.motion import ARM
from serpent_twin.recording.plan import Plan, plan

__all__ = ["Plan", "plan"]


def main(config: Plan) -> None:
    found = plan(config)
    about = found.motion.about
    if about["rig"] == ARM:
        next_step.say(after_plan(config.out, found.motion.rate_hz, about["arm"]))
    else:
        print(f"Record {about['arm']} as it follows the motion, and trace that with its logs.")


def after_plan(motion: Path, rate_hz: float, arm: str) -> next_step.Words:
    """Let the arm follow the motion."""
    out = next_step.named_after(motion.parent, motion.with_suffix(""), "motion", "next_logs")
    return next_step.step("follow", motion=motion, arm=arm, rate=rate_hz, out=out)


if __name__ == "__main__":
    cli.run(main)
