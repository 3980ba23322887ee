"""Plan the motion that decides what a trace left open: `python -m serpent_twin.plan`."""

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.planning.run import Plan, plan
from serpent_twin.recording.motion import ARM

__all__ = ["Plan", "plan"]


def main(config: Plan) -> None:
    found = plan(config)
    about = found.motion.about
    if about["rig"] == ARM:
        next_step.say(next_step.after_plan(config.out, found.motion.rate_hz, about["arm"]))
    else:
        next_step.say(
            None, f"Record {about['arm']} as it follows the motion, and trace that with its logs."
        )


if __name__ == "__main__":
    cli.run(main)
