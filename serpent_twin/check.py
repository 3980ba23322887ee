"""Tell which parameters and effects logs can show: `python -m serpent_twin.check`."""

import sys
from pathlib import Path

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.identification.check_logs import Check, check

__all__ = ["Check", "check"]


def main(config: Check) -> None:
    found = check(config)
    rig = "" if config.machine or config.rig == "arm" else config.rig
    out = next_step.named_after(Path(), config.logs[-1], "logs", "trace")
    words = {"logs": config.logs, "rig": rig, "machine": config.machine, "out": out}
    next_step.say(next_step.step("trace", **words))
    if found.hidden:
        sys.exit(1)


if __name__ == "__main__":
    cli.run(main, error_status=2)
