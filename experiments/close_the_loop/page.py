"""Lay out the errors before and after the loop was closed."""

from collections.abc import Mapping
from typing import Any

from serpent_twin.identification.diagnosis import ParameterEstimate
from serpent_twin.identification.wording import full_name, spaced, with_numbers
from serpent_twin.reporting.report import Report, Section, Table

STAGES = ("nominal", "calibrated", "corrected")


def table(found: Mapping[str, dict[str, Any]]) -> Table:
    """One row an arm: errors before and after, what was missing, what is left."""
    header = (
        "arm",
        *(f"{stage} [mm]" for stage in STAGES),
        "cameras alone [mm]",
        *(f"loads {stage} [% of stall]" for stage in STAGES),
        "what the twin lacked",
        "unexplained",
    )
    rows = tuple(_row(name, each) for name, each in found.items())
    note = (
        "Held-out sessions, to which nothing was fitted; prescribed motor angles, 40 s segments. mm: mean "
        "marker distance; %: root mean square of the load error, of the stall torque. In brackets, 95 % "
        "intervals."
    )
    return Table(header, rows, note)


def _row(name: str, found: dict[str, Any]) -> tuple[str, ...]:
    error, load = found["error_mm"], found["load_error_percent"]
    rest = found["unexplained"]
    left = f"{100 * rest['share']:.0f} % of the squared error" if rest["is"] else "no"
    return (
        name,
        *(f"{error[stage]:.2f}" for stage in STAGES),
        "–" if error["noise_floor"] is None else f"{error['noise_floor']:.2f}",
        *(f"{load[stage]:.2f}" for stage in STAGES),
        "; ".join(map(_lacked, found["effects"])) or "nothing known",
        left,
    )


def _lacked(effect: Mapping[str, Any]) -> str:
    values = {name: ParameterEstimate(**each) for name, each in effect["parameters"].items()}
    return with_numbers(full_name(effect), values)


def page(results: Mapping[str, Any], figure: Any) -> Report:
    """The report."""
    found = results["arms"]
    sections = [Section("Before and after", "", (table(found),))]
    if figure:
        sections.append(Section("One moment", "", (figure,)))
    if what := unexplained(found):
        sections.append(Section("What stays unexplained", what))
    facts = {"commit": str(results["git_commit"])}
    facts |= {k: str(v) for k, v in results["settings"].items() if k != "input_sha256"}
    facts |= {f"seconds, {name}": f"{each['seconds']:.0f}" for name, each in found.items()}
    return Report(f"The loop closed on {', '.join(found)}", lead(found), tuple(sections), facts)


def unexplained(found: Mapping[str, dict[str, Any]]) -> str:
    """On what the errors that no effect explains depend, a paragraph an arm."""
    left = {name: each["unexplained"] for name, each in found.items()}
    return "\n\n".join(f"{name}: {of['depends_on']}" for name, of in left.items() if of["is"])


def lead(found: Mapping[str, dict[str, Any]]) -> str:
    """One sentence that the numbers support."""
    said = []
    for name, each in found.items():
        error = each["error_mm"]
        named = " and ".join(spaced(full_name(effect)) for effect in each["effects"])
        why = f"it lacked {named}" if named else "no effect was named"
        if each["unexplained"]["is"]:
            why += ", and a part stays unexplained"
        said.append(f"{name}, {error['nominal']:.1f} → {error['corrected']:.2f} mm ({why})")
    return f"Marker error on held-out sessions, nominal → corrected: {'; '.join(said)}."
