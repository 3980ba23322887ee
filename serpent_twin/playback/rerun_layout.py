"""Lay out a recording in rerun's window: the arm, its colours in words, and plots with legends."""

from collections.abc import Mapping

import rerun as rr
import rerun.blueprint as rrb

from serpent_twin.arm.mjcf import STRANDS

Plot = rrb.TimeSeriesView | rrb.Horizontal
"""One plot, or some side by side"""
KEY, LOADS, TENSIONS = "key", "plots/load", "plots/tension"
"""Entities of the colours in words, of the motors' loads and of the strands' tensions"""
TEN = 2
"""Share of the height for a plot with a legend of ten lines, beside one with a few"""
_SIDES = {"+": "plus", "−": "minus"}


def blueprint(title: str, plots: Mapping[Plot, int] | None = None) -> rrb.Blueprint:
    """The arm large with its colours below it, plots beside it, each with its share of the height: by
    default those of a session.
    """
    eye = rrb.EyeControls3D(
        position=(0.12, 0.46, 0.62), look_target=(0.135, 0.01, 0.0), eye_up=(-1, 0, 0)
    )
    scene = rrb.Spatial3DView(
        origin="/", contents=["arm/**", "markers/**"], name=title, eye_controls=eye,
        background=(28, 31, 36), line_grid=False,
    )  # fmt: skip
    words = rrb.Horizontal(
        rrb.TextDocumentView(origin=KEY, name="Colours"),
        rrb.TextDocumentView(origin="about", name="About"),
    )
    plots = _plots() if plots is None else plots
    beside = rrb.Vertical(*plots, row_shares=list(plots.values()))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(scene, words, row_shares=[7, 3]),
            beside,
            column_shares=[5, 4],
        ),
        rrb.TimePanel(state="collapsed", timeline="time"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def key(looks: Mapping[str, str]) -> rr.TextDocument:
    """The meaning of each colour, as a table."""
    rows = [f"| {colour} | {what} |" for colour, what in looks.items()]
    table = "\n".join(["| colour | what it shows |", "| --- | --- |", *rows])
    return rr.TextDocument(table, media_type="text/markdown")


def loads() -> rrb.TimeSeriesView:
    """The ten motors' loads, whose legend needs a height of `TEN`."""
    name = "Motor load [% of stall]"
    return rrb.TimeSeriesView(origin=LOADS, name=name, plot_legend=_legend())


def short(strand: str) -> str:
    """A strand's name in a legend, such as `cable 3+`."""
    motor, side = strand.removeprefix("cable").split("_")
    return next(f"cable {motor}{sign}" for sign, word in _SIDES.items() if word == side)


def _plots() -> dict[Plot, int]:
    error = rrb.TimeSeriesView(
        origin="plots/error", name="Marker error, mean of nine [mm]", plot_legend=_legend()
    )
    return {error: 1, loads(): TEN, rrb.Horizontal(*map(_tensions, _SIDES)): TEN}


def _tensions(sign: str) -> rrb.TimeSeriesView:
    """Ten strands each: twenty lines and their legend are too many for one plot."""
    strands = [f"/{TENSIONS}/{name}" for name in STRANDS if name.endswith(_SIDES[sign])]
    name = f"Tension of the {sign} strands [N]"
    return rrb.TimeSeriesView(origin="/", contents=strands, name=name, plot_legend=_legend())


def _legend() -> rrb.PlotLegend:
    return rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=True)
