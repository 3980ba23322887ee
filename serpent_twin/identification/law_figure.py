"""Draw a composed law beside the free curve that tests it."""

from textwrap import fill

import numpy as np

from serpent_twin.effects.law import HANDLES
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery.free_curve import FreeCurve
from serpent_twin.runs.plot_style import COLOURS, INK, sheet, tidy
from serpent_twin.runs.report import Figure

_LABEL = 36  # characters in a line of the label


def composed_law(curve: FreeCurve, number: int) -> Figure:
    """A composed law over its reading, with the free curve that training logs give in its place."""
    drawing, axes = sheet(7, 3.2)
    panel = np.ravel(axes)[0]
    law = curve.law
    panel.plot(curve.reading, curve.fitted, color=COLOURS[0], lw=2, label="the law")
    panel.errorbar(
        curve.knots,
        curve.free,
        yerr=1.96 * curve.error,
        fmt="o",
        color=INK,
        capsize=3,
        label="a free curve, 95 %",
    )
    x = f"phase of {law.depends_on} [rad]" if curve.folded else law.depends_on
    if drags := SHAPES[law.shape].drags:
        x = drags.words.format(x=x)
    x += "" if curve.folded else f" [{curve.units['bound']}]"
    unit = curve.units["size"].partition(" per ")[0]
    panel.set(xlabel=x, ylabel=fill(f"{HANDLES[law.handle].told(law.place)} [{unit}]", _LABEL))
    panel.legend()
    tidy(panel, "y")
    said = "No clearly different curve describes the training logs better."
    if not curve.settled:
        said = (
            "The free curve describes the training logs better: the form of the law is not settled."
        )
    along = ", along its direction" if HANDLES[law.handle].components > 1 else ""
    caption = f"What was composed over what it depends on{along}. {said}"
    return Figure(f"composed_law_{number}", drawing, caption)
