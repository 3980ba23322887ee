"""Lay out the errors before and after the loop was closed."""

from collections.abc import Mapping
from typing import Any

from experiments.result_page import PageContent, traced_by_commit
from serpent_twin.identification.diagnosis import ParameterEstimate
from serpent_twin.identification.wording import full_name, spaced, with_numbers
from serpent_twin.numerals import counted
from serpent_twin.runs.report import Section, Table

STAGES = ("nominal", "calibrated", "corrected")
_NOTE = (
    "Held-out sessions, to which nothing was fitted; prescribed motor angles, 40 s segments. mm: mean "
    "marker distance; %: root mean square of the load error, of the stall torque. In brackets, 95 % "
    "intervals."
)


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    arms, settings = results["arms"], results["settings"]
    command = "python -m experiments.close_the_loop --logs LOGS"
    command += f" --sessions {settings['sessions']} --out close_the_loop"
    data = "; ".join(
        f"{name}: {counted(len(files), 'session')}, judged by {', '.join(arms[name]['held_out'])}"
        for name, files in settings["input_sha256"].items()
    )
    if len({arm.get("git_commit") for arm in arms.values()}) > 1:
        data += f"; {traced_by_commit(arms)}"
    sections = [Section("", "", (table(arms),))]
    if left := _unexplained(arms):
        sections.append(Section("What stays unexplained", left))
    title = f"Closing the loop on {counted(len(arms), 'arm')}"
    return PageContent(title, command, data, tuple(sections), _lead(arms))


def table(arms: Mapping[str, Mapping[str, Any]]) -> Table:
    """One row an arm: errors before and after, what was missing, what is left."""
    columns = {
        "arm": "{name}",
        **{f"{stage} [mm]": f"{{error_mm[{stage}]:.2f}}" for stage in STAGES},
        "cameras alone [mm]": _noise_floor,
        **{
            f"loads {stage} [% of stall]": f"{{load_error_percent[{stage}]:.2f}}"
            for stage in STAGES
        },
        "what the twin lacked": lambda arm: (
            "; ".join(map(_lacked, arm["effects"])) or "nothing known"
        ),
        "unexplained": _left,
    }
    return Table.of(({"name": name} | dict(arm) for name, arm in arms.items()), columns, _NOTE)


def _noise_floor(arm: Mapping[str, Any]) -> str:
    floor = arm["error_mm"]["noise_floor"]
    return "–" if floor is None else f"{floor:.2f}"


def _lacked(effect: Mapping[str, Any]) -> str:
    values = {name: ParameterEstimate(**each) for name, each in effect["parameters"].items()}
    return with_numbers(full_name(effect), values)


def _left(arm: Mapping[str, Any]) -> str:
    rest = arm["unexplained"]
    return f"{100 * rest['share']:.0f} % of the squared error" if rest["is"] else "no"


def _unexplained(arms: Mapping[str, Mapping[str, Any]]) -> str:
    """What the errors that no effect explains depend on, a paragraph an arm."""
    left = {name: each["unexplained"] for name, each in arms.items()}
    return "\n\n".join(f"{name}: {of['depends_on']}" for name, of in left.items() if of["is"])


def _lead(arms: Mapping[str, Mapping[str, Any]]) -> str:
    """One sentence that the numbers support."""
    said = []
    for name, each in arms.items():
        error = each["error_mm"]
        named = " and ".join(spaced(full_name(effect)) for effect in each["effects"])
        why = f"it lacked {named}" if named else "no effect was named"
        if each["unexplained"]["is"]:
            why += ", and a part stays unexplained"
        said.append(f"{name}, {error['nominal']:.1f} → {error['corrected']:.2f} mm ({why})")
    return f"Marker error on held-out sessions, nominal → corrected: {'; '.join(said)}."
