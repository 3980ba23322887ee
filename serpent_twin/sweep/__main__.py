"""`python -m serpent_twin.sweep`."""

from serpent_twin import cli
from serpent_twin.sweep.run import main

if __name__ == "__main__":
    cli.run(main)
