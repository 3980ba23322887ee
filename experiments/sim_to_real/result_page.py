"""Lay out the errors of all routes from simulation to the arm."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.result_page import PageContent
from experiments.sim_to_real.figures import changes, coverage, curves
from experiments.sim_to_real.twins import CALIBRATED, CORRECTED, NOMINAL, RANDOMISED, STAGES
from serpent_twin.identification.held_out import better
from serpent_twin.numerals import counted
from serpent_twin.runs.report import Figure, Section, Table

_UNIT = (
    "Mean distance between estimated and measured markers over the test session, in mm; no route has seen "
    "that session, nor has the twin."
)


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    arms = results["arms"]
    quick = " --quick" if results["settings"]["quick"] else ""
    command = f"python -m experiments.sim_to_real --logs LOGS{quick} --out sim_to_real"
    data = "; ".join(
        f"{name}: {counted(of['windows']['train'], 'window')} to learn from, tested on "
        f"{', '.join(of['test_sessions'])}"
        for name, of in arms.items()
    )
    text = f"{lead(arms)} [From simulation to the arm](../sim-to-real.md) describes the routes."
    sections = (
        Section("", text),
        Section("The routes", _UNIT, (arm_table(arms),)),
        Section("Without one real window", _claims(arms), (zero_table(arms),)),
        Section("With few real windows", "", (Figure("curves", curves(arms), _CURVES),)),
        Section(
            "Is it as sure as it says?", _sure(arms), (Figure("coverage", coverage(arms), _COVER),)
        ),
        Section("What the loads correct", _filter(arms), (filter_table(arms),)),
        Section("What it costs to follow a change", _FOLLOWS, (weighing_table(arms),)),
        Section("Conditions not trained for", _CONDITIONS, (condition_table(results),)),
        Section("An arm that changes on the way", _CHANGES, _changes(results)),
        Section("What an estimate costs", "", (cost_table(arms),)),
    )
    return PageContent("Sim to real", command, data, sections, lead(arms))


_CURVES = (
    "Error against the arm's windows that were used, at 4 windows a second; the leftmost points used none. "
    "Solid: residual_mlp. Dotted: residual, a ridge."
)
_COVER = (
    "Share of the markers inside the regions that the observer states; on the line it is right."
)
_FOLLOWS = (
    "Weighing observers let loads say what the gripper holds and how the stand leans. In sessions in which "
    "nothing changes, all that they have to follow is noise:"
)
_CHANGES = (
    "With markers: these correct from the first row on. An observer that follows has motor angles and loads "
    "alone."
)
_CONDITIONS = (
    "The arm is simulated here: it is a twin drawn as the fit is uncertain, so these figures show what a "
    "condition costs and not how wrong the twin is. In brackets: share of the markers in the 95 % regions."
)


def lead(arms: Mapping[str, Any]) -> str:
    """The conclusion."""
    known = {n: a for n, a in arms.items() if a["effects"] or not a["unexplained"]["is"]}
    shown = known or arms
    if stopped := cut_short(arms):
        off = _span([a["observer_mm"] for a in shown.values()])
        return f"The corrected twin, driven by motor angles, is off by {off} mm. {stopped}"
    share = [a["observer_mm"] / a["lstm_mm"] for a in shown.values()]
    zero = [a["zero_shot_mm"][CORRECTED] / a["all_real_mm"] for a in shown.values()]
    said = (
        f"The corrected twin, driven by motor angles, is {_span(share)} × as far off as the LSTM that was "
        f"trained on all of an arm's windows; a readout trained on it alone {_span(zero)} × as far as the "
        "same readout trained on the arm."
    )
    if rest := sorted(set(arms) - set(known)):
        worse = _span([arms[n]["observer_mm"] / arms[n]["lstm_mm"] for n in rest])
        said += f" Where no known effect explains what is left ({', '.join(rest)}), the first is {worse} ×."
    return said


def cut_short(arms: Mapping[str, Any]) -> str:
    """Sentence on networks whose training was stopped before its own rule ends it: nothing is compared with
    them.
    """
    stopped = {
        n: k for a in arms.values() for n, k in a.get("stopped_after_epochs", {}).items() if k
    }
    if not stopped:
        return ""
    names, epochs = " and ".join(stopped), max(stopped.values())
    return (
        f"The training of {names} was stopped after {epochs} epochs: nothing is compared with it."
    )


def _against(arm: Mapping[str, Any], name: str, ours: float, theirs: float) -> str:
    """Times the error of a readout; – if its training was cut short."""
    return "–" if arm.get("stopped_after_epochs", {}).get(name) else f"{ours / theirs:.2f}"


def _span(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.2f}" if f"{low:.2f}" == f"{high:.2f}" else f"{low:.2f} … {high:.2f}"


def arm_table(arms: Mapping[str, Any]) -> Table:
    """The routes side by side."""
    columns = {
        "arm": "{name}",
        "observer [mm]": "{observer_mm:.2f}",
        "tip [mm]": "{observer_tip_mm:.2f}",
        "LSTM, all real [mm]": "{lstm_mm:.2f}",
        "observer / LSTM": lambda a: _against(a, "lstm", a["observer_mm"], a["lstm_mm"]),
        "zero-shot [mm]": f"{{zero_shot_mm[{CORRECTED}]:.2f}}",
        "500 windows [mm]": lambda a: f"{a['few_shot_mm'].get('500', np.nan):.2f}",
        "all real [mm]": "{all_real_mm:.2f}",
        "zero-shot / all real": lambda a: _against(
            a, a["readout"], a["zero_shot_mm"][CORRECTED], a["all_real_mm"]
        ),
        "in 95 % regions [%]": lambda a: f"{100 * a['coverage_95']:.1f}",
    }
    readout = next(iter(arms.values()))["readout"]
    note = f"Zero-shot (trained on the corrected twin), few windows and all real are of {readout}."
    return Table.of(_named(arms), columns, f"{note} {cut_short(arms)}".strip())


def _named(arms: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Entries of arms with their names."""
    return [{"name": name} | arm for name, arm in arms.items()]


def zero_table(arms: Mapping[str, Any]) -> Table:
    """Errors of readouts trained on twins alone."""
    rows = []
    for name, a in arms.items():
        for readout, curve in a["curves_mm"].items():
            cells = tuple(f"{curve[stage]['0']:.2f}" for stage in STAGES)
            rows.append((name, readout, *cells, f"{curve['real alone']['all']:.2f}"))
        seen = a["observer_by_stage_mm"]
        cells = tuple(f"{seen[s]:.2f}" if s in seen else "" for s in STAGES)
        rows.append((name, "observer", *cells, ""))
        hybrid = a["hybrid_mm"]
        rows.append((name, "observer, residual learned", "", "", "", "", f"{hybrid['all']:.2f}"))
    header = ("arm", "readout", *(f"{stage} [mm]" for stage in STAGES), "all real windows [mm]")
    return Table(header, tuple(rows))


def _claims(arms: Mapping[str, Any]) -> str:
    if stopped := cut_short(arms):
        return stopped
    told = []
    for name, a in arms.items():
        zero, found = a["zero_shot_mm"], a["effects"]
        lacked = " and ".join(str(each["name"]) for each in found) or "nothing that was found"
        told.append(
            f"{name} lacked {lacked}: {zero[CORRECTED] / a['all_real_mm']:.2f} × what the arm's own windows "
            f"give, {zero[CORRECTED] / zero[NOMINAL]:.2f} × what the nominal twin gives; drawn twins "
            f"{zero[RANDOMISED]:.2f} in place of {zero[CORRECTED]:.2f} mm."
        )
    return " ".join(told)


def _sure(arms: Mapping[str, Any]) -> str:
    held = ", ".join(f"{100 * a['coverage_95']:.1f} % ({name})" for name, a in arms.items())
    return f"Regions stated for 95 % hold {held} of the test session's markers."


def _filter(arms: Mapping[str, Any]) -> str:
    gains = []
    for name, a in arms.items():
        for stage in (CALIBRATED, CORRECTED):
            gain = 1 - a["filtered_mm"][stage] / a["observer_by_stage_mm"][stage]
            gains.append(f"{better(gain)} ({name}, {stage})")
    return (
        "An ensemble Kalman filter corrects the twin's joints by what turning motors' loads differ from its "
        "own. "
        f"With it, estimates are {', '.join(gains)}."
    )


def filter_table(arms: Mapping[str, Any]) -> Table:
    """Errors with and without the loads' correction."""
    rows = [arm | {"stage": s} for arm in _named(arms) for s in (CALIBRATED, CORRECTED)]
    columns = {
        "arm": "{name}",
        "twin": "{stage}",
        "motor angles alone, mm": lambda a: f"{a['observer_by_stage_mm'][a['stage']]:.2f}",
        "with loads, mm": lambda a: f"{a['filtered_mm'][a['stage']]:.2f}",
        "scatter chosen, mrad": lambda a: f"{1e3 * a['filter_scatter_rad'][a['stage']]:.1f}",
    }
    return Table.of(rows, columns)


def condition_table(results: Mapping[str, Any]) -> Table:
    """Errors in each condition."""
    found = results["conditions"]["readouts"]
    columns: dict[str, Any] = {"condition": str}
    for name in next(iter(found.values())):
        columns[f"{name} [mm]"] = lambda condition, name=name: _cell(found[condition][name])
    note = (
        f"On a twin of {results['conditions']['arm']}; a readout of windows refuses another rate."
    )
    return Table.of(found, columns, note)


def _cell(one: Mapping[str, Any] | None) -> str:
    if one is None:
        return "refused"
    return f"{one['mean_mm']:.2f} ({100 * one['coverage_95']:.0f} %)"


def _changes(results: Mapping[str, Any]) -> tuple[Table | Figure, ...]:
    found = results["changes"]
    rows = [
        {"what": of["what"], "name": name} | each
        for of in found.values()
        for name, each in of["estimators"].items()
    ]
    columns = {
        "what happens": "{what}",
        "estimator": "{name}",
        "before, mm": "{before_mm:.2f}",
        "first 10 s, mm": "{first_10_s_mm:.2f}",
        "back after, s": lambda each: (
            "–" if each["recovered_s"] is None else f"{each['recovered_s']:.0f}"
        ),
        "at the end, mm": "{last_mm:.2f}",
    }
    note = "Back: a mean of 10 s within 1.25 × the error before; –: not."
    caption = "Error around the change, at the line."
    return Table.of(rows, columns, note), Figure("changes", changes(found), caption)


def weighing_table(arms: Mapping[str, Any]) -> Table:
    """Errors on sessions in which nothing changes."""
    columns = {"arm": "{name}", "observer, mm": "{observer_mm:.2f}"}
    for name in next(iter(arms.values()))["weighing_mm"]:
        columns[f"that follows {name}, mm"] = f"{{weighing_mm[{name}]:.2f}}"
    return Table.of(_named(arms), columns)


def cost_table(arms: Mapping[str, Any]) -> Table:
    """Milliseconds an estimate, on one core."""
    costs = [
        {"arm": arm, "observer": a["observer_latency_ms"]}
        | {f"that follows {name}": took for name, took in a["weighing_latency_ms"].items()}
        | a["latency_ms"]
        for arm, a in arms.items()
    ]
    columns = {"arm": "{arm}"}
    columns |= {f"{name} [ms]": f"{{{name}:.3f}}" for name in costs[0] if name != "arm"}
    note = "Median time from a reading to its estimate at the logs' rate, on one core."
    return Table.of(costs, columns, note)
