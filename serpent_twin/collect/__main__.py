"""`python -m serpent_twin.collect`."""

from serpent_twin import cli, next_step
from serpent_twin.collect import Collect, collect
from serpent_twin.numerals import counted


def main(config: Collect) -> None:  # noqa: D103 tyro would print it above the config's own
    paths = collect(config)
    print(f"{counted(len(paths), 'session')} of {counted(config.steps, 'row')} in {config.out}")
    next_step.say(next_step.after_logs(config.out, config.out.parent))


if __name__ == "__main__":
    cli.run(main)
