"""Record session logs of a bench arm, with effects that the logs do not state."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from serpent_twin.command_line import cli
from serpent_twin.errors import SerpentError

from .effects import NONE, TYPICAL, inject
from .parameters import draw
from .record import Job, record_many
from .session import RATE


def main(
    out: Path,
    effect: tuple[str, ...] = (),
    strength: tuple[float, ...] = (),
    seed: int = 0,
    sessions: int = 4,
    steps: int = 1200,
    payload_link: int = 9,
    payload_at: float = 0.090,
    cable: int = 0,
    side: int = 0,
) -> None:
    """Record a drawn arm's sessions into a folder, and the truth into `<folder>.truth.json` beside it.

    Args:
        out: Folder for session_NN.parquet.
        effect: What to inject, one name or several; nothing for a clean arm.
        strength: One per effect, in its unit; a clearly visible one if left out.
        seed: Of the arm, of where an effect sits, of targets and noise.
        sessions: How many sessions.
        steps: Control steps in each, at 4 Hz.
        payload_link: Which link carries a payload, 1 … 9.
        payload_at: How far behind that link's joint it sits [m].
        cable: Cable whose strands creep, stiffen, wear and rub, 1 … 9; 0 for all.
        side: Which of its strands: 1 for the + strand, -1 for the - strand, 0 for both.
    """
    strengths = strength or tuple(TYPICAL.get(name, 0.0) for name in effect)
    if len(strengths) != len(effect):
        raise SerpentError(
            f"There are {len(effect)} effects and {len(strengths)} strengths. Give one for each."
        )
    built, placed = np.random.SeedSequence(seed).spawn(2)
    effects = replace(
        NONE, payload_link=payload_link, payload_at=payload_at, cable=cable, side=side
    )
    rng = np.random.default_rng(placed)
    for name, value in zip(effect, strengths, strict=True):
        effects = inject(name, value, rng, effects, sessions * steps / RATE)
    arm = draw(np.random.default_rng(built))
    for path in record_many([Job(out, arm, effects, seed, sessions, steps)], progress=True)[0]:
        print(path)


if __name__ == "__main__":
    cli.run(main)
