"""Write how pushes of a real machine are felt as a page."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.pushes.logged import ACTS
from experiments.result_page import PageContent
from serpent_twin.numerals import counted
from serpent_twin.runs.plot_style import COLOURS, INK, SOFT, sheet, tidy
from serpent_twin.runs.report import Figure, Section, Table

Found = Mapping[str, Any]
Row = tuple[Found, str, Found]
"""Entry of a duration, name of its twin, and what that feels"""
_INTRODUCTION = """A controller swings the [double pendulum](measured-logs.md) of DFKI up while a pulse of
torque is added to the command of each joint, and logged. The estimate uses neither pulses nor currents.
Inverse dynamics of the twin say which torque the measured motion needs; what the commands do not give of it
is the external torque, here below {hz:.2g} Hz. The twin was fitted to two other logs, in which nothing
pushes, and the threshold at each joint is what their noise, if it were Gaussian, would exceed at a rate
of {rate:g} per minute. The push felt at a pulse is the strongest at its joint while the pulse is above
{acts:.0f} % of its peak."""
_ALARMS = """Felt where no pulse acts at any joint: in {unpushed:.1f} s of two logs that nothing pushes and
that nothing was fitted to, and in {pushed:.1f} s of the log with pulses. *Beyond the command* is what the
drive gave then besides command and pulse, by its current: a drive that does not give what it is commanded is
felt as a push."""
_DURATIONS = """Pushes of other durations are felt by other filters: the twin is fitted to motion and torques
below one cycle in that time, and external torques are filtered below the same frequency. The nominal twin is
the model as published. The first duration is that of the pulses at half their height: it was chosen with
them in view. [What was found in measured machines](measured-notes.md#pushed-pendulum) says what else was
tried."""


def result_page(results: Found) -> PageContent:
    """The page of a results.json."""
    several, settings = results["durations"], results["settings"]
    first = several[0]
    of, hz = first["twins"]["corrected"], 1 / first["shortest_s"]
    introduction = _INTRODUCTION.format(hz=hz, rate=settings["alarms_per_minute"], acts=100 * ACTS)
    return PageContent(
        "Pushes of a real machine",
        "python -m experiments.pushes --data measured --out pushes",
        "logs of `dfki_double_pendulum_c` and `dfki_perturbed`, recorded by others; "
        "[Logs of measured machines](measured-logs.md#get-the-logs) has their source and licence",
        (
            Section("", introduction, (_pulses(of), _drawn(first))),
            Section("False alarms", _ALARMS.format(**of["seconds"]), (_alarms(of),)),
            Section(
                "Other durations, and the model as published", _DURATIONS, (_durations(several),)
            ),
        ),
        _lead(of),
    )


def _lead(of: Found) -> str:
    felt, seconds = sum(each["felt"] is not None for each in of["pulses"]), of["seconds"]
    return (
        f"{felt} of {counted(len(of['pulses']), 'pulse')} felt at the right joint, with "
        f"{counted(len(of['alarms']), 'false alarm')} in {sum(seconds.values()):.1f} s."
    )


def _pulses(of: Found) -> Table:
    columns = {
        "joint": "{joint}",
        "pulse at [s]": "{time:.2f}",
        "size [N m]": "{size:.2f}",
        "felt [N m]": lambda row: _if_felt(row, lambda felt: f"{felt['size']:.2f}"),
        "late by [ms]": lambda row: _if_felt(
            row, lambda f: f"{1e3 * (f['time'] - row['time']):.0f}"
        ),
        "felt from … to [s]": lambda row: _if_felt(
            row, lambda felt: f"{felt['begin']:.2f} … {felt['end']:.2f}"
        ),
        "threshold [N m]": lambda row: f"{of['threshold'][row['joint']]:.2f}",
    }
    there = counted(len(of["other_joint"]), "push", "pushes")
    return Table.of(of["pulses"], columns, f"At the other joint, {there} felt while a pulse acts.")


def _if_felt(row: Found, told: Any) -> str:
    return "not felt" if row["felt"] is None else told(row["felt"])


def _alarms(of: Found) -> Table:
    columns = {
        "log": "{log}",
        "joint": "{joint}",
        "at [s]": "{time:.2f}",
        "felt [N m]": "{size:.2f}",
        "beyond the command [N m]": "{undelivered:.2f}",
    }
    return Table.of(of["alarms"], columns)


def _durations(several: Sequence[Found]) -> Table:
    rows = [(each, name, of) for each in several for name, of in each["twins"].items()]

    def of_joints(key: str) -> Any:
        return lambda row: " / ".join(f"{value:.2f}" for value in row[2][key].values())

    def alarms(key: str) -> Any:
        def told(row: Row) -> str:
            unpushed = _unpushed(row[2])
            found = unpushed if key == "unpushed" else len(row[2]["alarms"]) - unpushed
            return f"{found} in {row[2]['seconds'][key]:.1f} s"

        return told

    columns = {
        "shortest push [s]": lambda row: f"{row[0]['shortest_s']:g}",
        "twin": lambda row: row[1],
        "noise [N m]": of_joints("noise"),
        "threshold [N m]": of_joints("threshold"),
        "pulses felt": lambda row: f"{_count(row[2])} of {len(row[2]['pulses'])}",
        "false alarms, other logs": alarms("unpushed"),
        "false alarms, pushed log": alarms("pushed"),
    }
    return Table.of(rows, columns, "Noise and thresholds are of shoulder / elbow.")


def _count(of: Found) -> int:
    return sum(each["felt"] is not None for each in of["pulses"])


def _unpushed(of: Found) -> int:
    """False alarms in logs that nothing pushes."""
    return sum(each["log"] not in of["pushed_logs"] for each in of["alarms"])


def _drawn(first: Found) -> Figure:
    of, rows = first["twins"]["corrected"], first["drawn"]
    drawing, panels = sheet(8, 5, rows=len(rows["felt"]))
    time = np.array(rows["time"], float)
    for axes, (joint, felt) in zip(panels, rows["felt"].items(), strict=True):
        axes.plot(time, np.array(felt, float), color=COLOURS[2], lw=1.2, label="felt")
        axes.plot(time, np.array(rows["logged"][joint], float), color=INK, lw=1.2, label="logged")
        for side in (-1, 1):
            axes.axhline(side * of["threshold"][joint], color=SOFT, lw=0.8, ls="--")
        axes.set(ylabel=f"{joint} [N m]", xlabel="time [s]" if axes is panels[-1] else "")
        tidy(axes)
    drawing.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", frameon=False)
    caption = "External torque at both joints beside the logged pulses; dashed, the thresholds."
    return Figure("pushes", drawing, caption)
