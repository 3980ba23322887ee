"""`python -m serpent_twin.trace`."""

from serpent_twin import cli
from serpent_twin.trace.run import main

if __name__ == "__main__":
    cli.run(main)
