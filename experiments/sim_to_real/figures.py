"""Draw how errors fall with real windows, and whether they are as large as stated."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from experiments.sim_to_real.twins import CALIBRATED, CORRECTED, NOMINAL, RANDOMISED
from serpent_twin.runs.plot_style import COLOURS, SOFT, label_axis, sheet, styles, tidy

_COLOUR = {
    "real alone": "#6f6f6f",
    NOMINAL: "#b9b9b9",
    CALIBRATED: "#6b9ac4",
    CORRECTED: COLOURS[2],
    RANDOMISED: "#e0a458",
}
_LABEL = {
    "real alone": "trained on the arm alone",
    NOMINAL: "on the nominal twin, then the arm",
    CALIBRATED: "on the calibrated twin, then the arm",
    CORRECTED: "on the corrected twin, then the arm",
    RANDOMISED: "on twins drawn about it, then the arm",
}
_APART = 1.6  # times, so that their labels keep apart
_ZERO = 30  # where no window at all is drawn on a logarithmic axis


def curves(arms: Mapping[str, Any]) -> Figure:
    """Error against real windows, an arm a panel."""
    columns = min(2, len(arms))
    rows = -(-len(arms) // columns)
    figure, panels = sheet(5.2 * columns, 3.6 * rows, columns, rows)
    for axes in panels[len(arms) :]:
        axes.set_visible(False)
    for axes, (name, a) in zip(panels, arms.items(), strict=False):
        most = a["windows"]["train"]
        for readout, style in (("residual_mlp", "o-"), ("residual", ".:")):
            for route, curve in a["curves_mm"][readout].items():
                at = [_place(count, most) for count in curve]
                label = _LABEL[route] if style == "o-" else None
                axes.plot(at, list(curve.values()), style, color=_COLOUR[route], label=label, ms=4)
        hybrid = {"0": a["observer_mm"]} | a["hybrid_mm"]
        at = [_place(count, most) for count in hybrid]
        axes.plot(
            at,
            list(hybrid.values()),
            "s-",
            color="#344e41",
            label="the twin as observer, then corrected",
            ms=4,
        )
        axes.axhline(a["lstm_mm"], color="#16425b", lw=1, ls="--", label="LSTM, all windows")
        axes.set(
            xscale="log", yscale="log", title=name, xlabel="real windows", ylabel="mean error [mm]"
        )
        counts = [count for count in (100, 500, 2000) if _APART * count < most]
        axes.set_xticks([_ZERO, *counts, most], [f"{n:,}" for n in (0, *counts, most)], fontsize=8)
        axes.minorticks_off()
        label_axis(axes.yaxis)
        tidy(axes, grid="both")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    return figure


def _place(count: str, most: int) -> float:
    return {"0": float(_ZERO), "all": float(most)}.get(count) or float(count)


def coverage(arms: Mapping[str, Any]) -> Figure:
    """Share stated against share found."""
    figure, (axes,) = sheet(4.6, 4.2)
    axes.plot([0.45, 1], [0.45, 1], color=SOFT, lw=1)
    for (name, a), style in zip(arms.items(), styles(), strict=False):
        stated = [float(share) for share in a["coverage"]]
        axes.plot(stated, list(a["coverage"].values()), **style, ms=4.5, label=name)
    axes.set(xlabel="stated share", ylabel="share of markers inside", xlim=(0.45, 1), ylim=(0.3, 1))
    axes.legend(frameon=False)
    tidy(axes, grid=None)
    return figure


def changes(found: Mapping[str, Any]) -> Figure:
    """Error while an arm changes, a change a panel, an estimator a line."""
    figure, panels = sheet(8, 3.2 * len(found), rows=len(found))
    for axes, of in zip(panels, found.values(), strict=True):
        for (name, each), style in zip(of["estimators"].items(), styles(), strict=False):
            style = style | {"marker": ""}
            mean = np.convolve(np.array(each["error_mm"]), np.ones(20) / 20, "valid")
            axes.plot((np.arange(len(mean)) + 10) / 4, mean, **style, lw=1.2, label=name)
        axes.axvline(of["at_row"] / 4, color=SOFT, lw=1)
        axes.set(
            xlabel="time [s]", ylabel="error, mean of 5 s [mm]", yscale="log", title=of["what"]
        )
        label_axis(axes.yaxis)
        tidy(axes, grid=None)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    return figure
