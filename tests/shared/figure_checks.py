"""What can be wrong with a figure, by matplotlib's own boxes."""

import itertools

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

FEWEST = 2  # labels of a logarithmic axis


def draw(drawing):
    """Lay a figure out, twice: places of its axes after each."""
    canvas, places = FigureCanvasAgg(drawing), []
    for _ in range(2):
        canvas.draw()
        places.append([axes.get_position().bounds for axes in drawing.axes])
    return places


def texts(drawing):
    """All text that is seen, with its box in pixels; a tick's label only within its axis's limits."""
    renderer, found = drawing.canvas.get_renderer(), []
    ticks = {}
    for axes in drawing.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            margin = 1e-9 * (high - low)
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                inside = low - margin <= tick.get_loc() <= high + margin
                ticks |= {id(label): inside for label in (tick.label1, tick.label2)}
    for each in drawing.findobj(Text):
        if each.get_text().strip() and _seen(each) and ticks.get(id(each), True):
            found.append((each.get_text(), each.get_window_extent(renderer)))
    return found


def _seen(artist):
    return artist.get_visible() and (
        getattr(artist, "axes", None) is None or artist.axes.get_visible()
    )


def overlaps(drawing, slack=1.0):
    """Pairs of texts whose boxes meet by more than some pixels."""
    return [
        (a, b)
        for (a, one), (b, other) in itertools.combinations(texts(drawing), 2)
        if min(one.x1, other.x1) - max(one.x0, other.x0) > slack
        and min(one.y1, other.y1) - max(one.y0, other.y0) > slack
    ]


def cut_off(drawing, slack=1.0):
    """Texts that end beyond what is saved, which is cut tightly around all that matplotlib lays out."""
    renderer = drawing.canvas.get_renderer()
    box = drawing.get_tightbbox(renderer).transformed(drawing.dpi_scale_trans)
    return [
        text
        for text, one in texts(drawing)
        if one.x0 < box.x0 - slack or one.y0 < box.y0 - slack or one.x1 > box.x1 + slack
        or one.y1 > box.y1 + slack
    ]  # fmt: skip


def bare_logarithms(drawing):
    """Logarithmic axes with fewer labels within their limits than a reader needs to tell their values."""
    bare = []
    for axes in drawing.axes:
        if not axes.get_visible():
            continue
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == "log" and len(_labelled(axis)) < FEWEST:
                bare.append((axes.get_xlabel(), axes.get_ylabel(), _labelled(axis)))
    return bare


def _labelled(axis):
    """Places of labels; an axis that shares another's shows none of its own."""
    low, high = sorted(axis.get_view_interval())
    shared = (
        axis.axes.get_shared_y_axes() if axis.axis_name == "y" else axis.axes.get_shared_x_axes()
    )
    found = set()
    for axes in shared.get_siblings(axis.axes):
        own = axes.yaxis if axis.axis_name == "y" else axes.xaxis
        for tick in (*own.get_major_ticks(), *own.get_minor_ticks()):
            if (
                tick.label1.get_text()
                and tick.label1.get_visible()
                and low <= tick.get_loc() <= high
            ):
                found.add(round(tick.get_loc(), 12))
    return sorted(found)


def unsettled(places):
    """Axes that are laid out otherwise each time a figure is drawn: text in them asks for more room."""
    pairs = enumerate(zip(*places, strict=True))
    return [n for n, (a, b) in pairs if max(abs(x - y) for x, y in zip(a, b, strict=True)) > 0.01]


def wrong(drawing):
    """All that is wrong with a figure."""
    found = {"unsettled": unsettled(draw(drawing)), "overlaps": overlaps(drawing),
             "cut off": cut_off(drawing), "bare": bare_logarithms(drawing)}  # fmt: skip
    return {name: each for name, each in found.items() if each}
