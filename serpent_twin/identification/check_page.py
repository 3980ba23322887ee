"""Write what logs can tell as a report, and its tables."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from serpent_twin.identification.acceptance import MIN_GAIN, MIN_Z
from serpent_twin.identification.fitting.null_space import NOTHING
from serpent_twin.identification.identifiability import Identifiability
from serpent_twin.identification.wording import spaced
from serpent_twin.numerals import counted, listed
from serpent_twin.residual import ANGLE
from serpent_twin.runs.plot_style import COLOURS, INK, SOFT, label_logarithmic, sheet, tidy
from serpent_twin.runs.report import Figure, Report, Section, Table

MOST_ROWS = 15
"""Parameters that a table lists: the logs tell more of the others"""


def page(found: Identifiability, facts: Mapping[str, str]) -> Report:
    """The report of a check: effects, parameters and their combinations, motors and joints."""
    directions = "\n\n".join(f"• {each}." for each in found.directions)
    sections = (
        effects_section(found),
        Section("Which parameters they can tell", _PARAMETERS, (parameters(found),)),
        combined_section(found),
        Section("What they tell least", f"{_DIRECTIONS}\n\n{directions}"),
        Section("Which motion", _INPUTS, (inputs(found),)),
    )
    return Report(
        f"What the logs in {facts.get('logs', 'a folder')} can tell",
        " ".join([found.sentence(), *found.notes]),
        tuple(each for each in sections if each),
        facts,
    )


def effects_section(found: Identifiability) -> Section:
    """How weak an effect may be and still be found, delays first."""
    text = "\n\n".join([_EFFECTS, *found.not_sought])
    return Section("Which effects these logs can show", text, (_limits(found), effects(found)))


def effects(found: Identifiability) -> Table:
    """Every candidate with its detection limit."""
    columns = {
        "effect": lambda each: spaced(each.name),
        "least strength": lambda each: _short(each.limit),
        "typical": lambda each: _short(each.typical),
        "unit": _unit,
        "with a": lambda each: each.beside,
        "taken up [%]": lambda each: f"{100 * each.taken_up:.0f}",
        "can be told": lambda each: "yes" if each.told else "no",
        "confounded with": lambda each: each.why or listed(map(spaced, each.confounded_with)),
    }
    note = "Least strength: none where these logs show the effect at no strength."
    return Table.of(found.effects, columns, note, lambda each: not each.told)


def parameters(found: Identifiability) -> Table:
    """The declared parameters of which the logs tell least, relative to the prior."""
    least = sorted(found.parameters, key=lambda each: -each.ratio)[:MOST_ROWS]
    columns = {
        "parameter": lambda each: each.name,
        "prior": lambda each: _short(each.prior),
        "with logs": lambda each: _short(each.posterior),
        "unit": _unit,
        "ratio": lambda each: f"{each.ratio:.2f}",
        "variance inflation": lambda each: f"{each.variance_inflation:.1f}",
        "most confounded with": lambda each: (
            f"{each.confounded_with} ({each.correlation:+.2f})".replace("-", "−")
            if each.confounded_with
            else "nothing"
        ),
    }
    note = (
        f"The {len(least)} of {counted(len(found.parameters), 'parameter')} of which the logs tell least. "
        "Standard deviations; the variance inflation is the variance over that with all other parameters "
        "known; in brackets, the correlation."
    )
    return Table.of(least, columns, note)


def combined_section(found: Identifiability) -> Section | None:
    """Changes of parameters that no row shows, if there are any."""
    if not found.combined:
        return None
    return Section("What they cannot separate", _COMBINED, (combined(found),))


def combined(found: Identifiability) -> Table:
    """The parameters that no row determines, and changes of several that no row shows."""
    alone = [str(each) for each in found.combined if len(each.changes) == 1]
    rows = [(NOTHING, listed(alone))] if alone else []
    rows += [(each.told, str(each)) for each in found.combined if len(each.changes) > 1]
    columns = {"determined": lambda row: row[0], "changes that no row shows": lambda row: row[1]}
    note = (
        f"{counted(len(found.combined), 'combination')} of {counted(len(found.parameters), 'parameter')} "
        "that the logs narrow by less than 5 %. In a fit they stay where the prior has them."
    )
    return Table.of(rows, columns, note)


def _unit(each: Any) -> str:
    return "" if each.unit == "1" else each.unit


def inputs(found: Identifiability) -> Table:
    """How far and how fast every motor and joint moves."""
    note = "Motors as logged, joints as the twin has them. The speed is a root mean square."
    moves = {"moves": lambda each: "no" if each.still else "yes"}
    name = {"motor or joint": lambda each: each.name}
    if all(each.measure == ANGLE for each in found.inputs):
        angles = {
            "range [°]": lambda each: f"{np.degrees(each.range):.1f}",
            "speed [°/s]": lambda each: f"{np.degrees(each.speed):.1f}",
        }
        return Table.of(found.inputs, name | angles | moves, note)
    others = {
        "range": lambda each: f"{each.measure.scale * each.range:.3g}",
        "speed [1/s]": lambda each: f"{each.measure.scale * each.speed:.3g}",
        "unit": lambda each: each.measure.unit,
    }
    return Table.of(found.inputs, name | others | moves, note)


def _limits(found: Identifiability) -> Figure:
    """Detection limits as times the typical strength."""
    drawing, (axes,) = sheet(9, 0.32 * len(found.effects) + 1.2)
    most = 1e3
    for n, each in enumerate(found.effects):
        colour = COLOURS[3 if each.told else 2]
        marks = ((each.by_scatter, "|", SOFT), (each.by_gain, "x", SOFT), (each.limit, "o", colour))
        for value, marker, shade in marks:
            axes.plot(min(value / each.typical, most), n, marker, color=shade, ms=7)
    axes.axvline(1, color=INK, lw=1, ls=":")
    axes.set_xscale("log")
    axes.set_yticks(range(len(found.effects)), [spaced(each.name) for each in found.effects])
    axes.set(ylim=(len(found.effects) - 0.4, -0.6), xlabel="least strength / typical strength")
    axes.tick_params(axis="y", length=0)
    tidy(axes, "x")
    label_logarithmic(axes)
    caption = (
        f"The least strength that is found, as times a typical one: |, {MIN_Z:.0f} standard errors from "
        f"zero; ×, a gain of {100 * MIN_GAIN:.0f} %; the dot is the larger of both. Right of the dotted "
        "line, a typical strength would not be found."
    )
    return Figure("detection_limits", drawing, caption)


def _short(value: float) -> str:
    return f"{value:.3g}".replace("-", "−") if np.isfinite(value) else "none"


_EFFECTS = (
    f"The least strength at which an effect is {MIN_Z:.0f} standard errors from zero and betters the error "
    f"by {100 * MIN_GAIN:.0f} %, beside what calibration and the other effects leave, once a fit of all "
    "parameters took up what it can. Taken up is the share of what the effect changes that the declared "
    "parameters imitate. Delays come first: a delay makes everything else look like something else."
)
_PARAMETERS = (
    "The prior is what is known before the fit: the declared number, or a first guess out of the same logs. "
    "A ratio near 1 means that the fit adds nothing to it."
)
_COMBINED = (
    "Parameters change together by the stated amounts, and all that the logs measure stays as it is. What is "
    "fixed beside a combination, as by a known load, makes the others identifiable."
)
_DIRECTIONS = "The combinations of parameters of which the logs tell least, relative to the prior:"
_INPUTS = "What the motion of a motor or joint would show, no log tells in which it never moves."
