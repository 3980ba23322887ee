"""`python -m serpent_twin.collect`."""

from serpent_twin import cli
from serpent_twin.collect import Collect, collect


def main(config: Collect) -> None:  # noqa: D103 tyro would print it above the config's own
    paths = collect(config)
    print(f"{len(paths)} sessions of {config.steps} rows in {config.out}")


if __name__ == "__main__":
    cli.run(main)
