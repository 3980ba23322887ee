"""Tell which parameters and effects logs can show: `python -m serpent_twin.check`."""

import sys

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.identification.check_logs import Check, check

__all__ = ["Check", "check"]


def main(config: Check) -> None:
    found = check(config)
    next_step.say(next_step.after_check(config))
    if found.hidden:
        sys.exit(1)


if __name__ == "__main__":
    cli.run(main, error_status=2)
