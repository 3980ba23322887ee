"""Find what the twin of a logged machine lacks: `python -m serpent_twin.trace`."""

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.identification.run import Trace, trace

__all__ = ["Trace", "trace"]


def main(config: Trace) -> None:
    trace(config)
    next_step.say(next_step.after_trace(config))


if __name__ == "__main__":
    cli.run(main)
