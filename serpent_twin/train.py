"""Train pose readouts on session logs and score them: `python -m serpent_twin.train`."""

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.training.train import Train, carried_out, planned, train

__all__ = ["Train", "train"]


def main(config: Train) -> None:
    plan = planned(config)
    step = next_step.after_training(plan, carried_out(plan))
    next_step.say(step, next_step.without_observer(plan))


if __name__ == "__main__":
    cli.run(main)
