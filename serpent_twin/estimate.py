"""Estimate the arm's pose while it moves: `python -m serpent_twin.estimate`."""

import sys

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.live.estimate import estimate
from serpent_twin.live.options import Estimate


def main(config: Estimate) -> None:  # noqa: D103 tyro would print it above the config's own
    try:
        estimate(config)
    except KeyboardInterrupt:
        print(f"\nStopped. The rows until then are in {config.out}.", file=sys.stderr)
        sys.exit(130)
    print(f"{config.out}: the log, its figures and its recording")
    session, twin = config.out / "session_01.parquet", config.twin or config.simulate
    next_step.say(next_step.replay(session, config.out.parent, config.model, twin))


if __name__ == "__main__":
    cli.run(main)
