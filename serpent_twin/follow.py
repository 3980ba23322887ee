"""Let the arm follow a path: `python -m serpent_twin.follow`."""

import sys

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.live.follow import follow
from serpent_twin.live.follow_options import Follow


def main(config: Follow) -> None:  # noqa: D103 tyro would print it above the config's own
    try:
        follow(config)
    except KeyboardInterrupt:
        print(f"\nStopped. The rows until then are in {config.out}.", file=sys.stderr)
        sys.exit(130)
    print(f"{config.out}: the log, its figures, its picture and its recording")
    session = config.out / "session_01.parquet"
    next_step.say(next_step.replay(session, config.out.parent, config.model, config.twin))


if __name__ == "__main__":
    cli.run(main)
