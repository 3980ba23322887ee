"""Find what the twin of a logged machine lacks: `python -m serpent_twin.trace`.

Called as `serpent_twin.trace(robot)` in Python, it is `serpent_twin.robots.trace`.
"""

from serpent_twin import next_step
from serpent_twin.callable_module import make_callable
from serpent_twin.command_line import cli
from serpent_twin.identification.run import Trace, trace

__all__ = ["Trace", "trace"]
make_callable(__name__)


def main(config: Trace) -> None:
    trace(config)
    next_step.say(next_step.after_trace(config))


if __name__ == "__main__":
    cli.run(main)
