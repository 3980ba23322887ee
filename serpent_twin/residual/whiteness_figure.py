"""Draw how white a residual is, and which channels follow an input."""

import numpy as np

from serpent_twin.reporting.plot_style import COLOURS, INK, SOFT, sheet, tidy
from serpent_twin.reporting.report import Figure
from serpent_twin.residual.whiteness import Whiteness

_LABELS = 20  # channels that are named


def whiteness_figure(found: Whiteness) -> Figure | None:
    """Autocorrelations of all channels, and their strongest correlation with an input; None without any."""
    if not found.channels:
        return None
    drawing, (left, right) = sheet(9, 3.9, columns=2)
    rho = np.array([each.autocorrelation[1:] for each in found.channels])
    end = (found.lags + 0.5) * found.period
    image = left.imshow(
        rho, aspect="auto", cmap="RdBu_r", vmin=-1, vmax=1, interpolation="nearest",
        extent=(0.5 * found.period, end, len(rho) - 0.5, -0.5),
    )  # fmt: skip
    left.set_xlabel("lag [s]")
    left.locator_params(axis="x", nbins=5)
    every = -(-len(rho) // _LABELS)
    names = [each.name for each in found.channels][::every]
    left.set_yticks(range(0, len(rho), every), names, fontsize=7)
    left.tick_params(colors=SOFT, labelcolor=INK, length=0)
    bar = drawing.colorbar(image, ax=left, pad=0.01)
    bar.set_label("autocorrelation")
    bar.outline.set_visible(False)  # pyright: ignore
    for n, each in enumerate(found.channels):
        right.barh(n, abs(each.correlation), height=0.7, color=COLOURS[2 if each.follows else 0])
        right.plot([each.input_bound] * 2, [n - 0.4, n + 0.4], color=INK, lw=1)
    right.set(
        ylim=(len(rho) - 0.5, -0.5), xlim=(0, 1), xlabel="strongest correlation with an input"
    )
    right.set_yticks([])
    tidy(right, "x")
    caption = (
        "Left, the autocorrelation of each channel of the residual: white noise has none. Right, its "
        f"strongest correlation with {found.inputs} at any lag; the mark is what chance reaches in one case "
        "of 20."
    )
    return Figure("whiteness", drawing, caption)
