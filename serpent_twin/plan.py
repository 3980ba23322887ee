"""Plan the motion that decides what a trace left open: `python -m serpent_twin.plan`."""

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.planning.run import Plan, plan

__all__ = ["Plan", "plan"]


def main(config: Plan) -> None:
    found = plan(config)
    next_step.say(next_step.after_plan(config.out, found.motion.rate_hz, found.motion.about["arm"]))


if __name__ == "__main__":
    cli.run(main)
