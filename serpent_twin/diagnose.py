"""Find what a robot's model lacks, from its model and its logs: `python -m serpent_twin.diagnose`."""

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.diagnosing import Diagnose, diagnose

__all__ = ["Diagnose", "diagnose"]


def main(config: Diagnose) -> None:
    next_step.say(next_step.after_trace(diagnose(config)))


if __name__ == "__main__":
    cli.run(main)
