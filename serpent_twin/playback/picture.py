"""Draw one moment of a session: the arm, and its markers as measured and as predicted."""

from pathlib import Path

from serpent_twin.playback.moments import already_there, draw, row_at, says
from serpent_twin.playback.shown import ShownSession
from serpent_twin.runs.files import replacing

KEY = "serpent_twin"
"""Key of the text in the picture's file that says what it was made of"""


def draw_picture(shown: ShownSession, time: float, out: Path) -> None:
    """Write a PNG of a session at a time [s], unless it is there."""
    from PIL import Image, PngImagePlugin

    from serpent_twin.playback.drawn_arm import pencil

    row = row_at(shown, time)
    name = shown.identity("picture", row)
    if already_there(out, "the picture of this moment", says(name)):
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    with pencil() as drawing:  # what it lacks is said before anything is simulated
        picture = draw(shown, row, drawing)
    about = PngImagePlugin.PngInfo()
    about.add_text(KEY, name)
    with replacing(out) as part:
        Image.fromarray(picture).save(part, format="PNG", optimize=True, pnginfo=about)
