"""Record sessions of the arm or of its twin: `python -m serpent_twin.collect`."""

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.numerals import counted
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect


def main(config: Collect) -> None:  # noqa: D103 tyro would print it above the config's own
    paths = collect(config)
    print(f"{counted(len(paths), 'session')} of {counted(config.rows, 'row')} in {config.out}")
    next_step.say(next_step.after_logs(config.out, config.out.parent))


if __name__ == "__main__":
    cli.run(main)
