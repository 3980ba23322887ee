"""Write how often a law at a place was named, in models of others, as a page."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.any_model.score import WITHIN, Row, covered, off, right, told, undecided
from experiments.any_model.trial import CLEAN, COMPOSED
from experiments.result_page import PageContent, failures
from serpent_twin.effects import law_of
from serpent_twin.identification.wording import spaced
from serpent_twin.numerals import counted
from serpent_twin.runs.report import Section, Table

_TEXT = """Each machine is a public model (dm_control's pendulum, acrobot and reacher, the hind leg of its
cheetah, Kinova's six-joint arm with position servos) with one fault at one place, or with none. Its log is
a CSV with what the actuators are told and what the joints' encoders read, at 50 Hz with noise of 0.3 mrad;
the last of {sessions} judges. The data come from another integration than the twin's (Runge-Kutta, 0.25 ms),
and the fault is a force, a command or a reading computed there, which shares nothing with the twin's effect.
The machine.toml of each lists the drives and the joints, nothing else: numbers that calibration fits and
candidates are the default. Strengths are above the detection limits that the traces state; below them
nothing is named."""
_TORQUES = """Each machine is a public model (dm_control's pendulum, acrobot and reacher, the hind leg of its
cheetah, Kinova's six-joint arm) with a drive at each joint and one fault at one place, or with none. A
controller with the model's own torques closes its motion at 1 kHz. Its log is a CSV with the joints' angles,
by encoders of 16 bit, and what the drives say that they gave, with noise of 1 % of the most that they give,
at 200 Hz; the last of {sessions} judges. The data come from an integration (Runge-Kutta, 0.25 ms), the
twin's torques from inverse dynamics, and the fault is a force computed there, which shares nothing with
the twin's effect. The machine.toml of each lists angles and torques, nothing else: all inertia numbers,
damping and zeros of torques are fitted."""
_COMPOSED = """Of a bumper ("soft stop"), a joint that sticks in a window of its angle, a force that swings at
0.7 Hz and an encoder that waves, no catalogue has a law: those among these machines must be composed."""


def result_page(results: Mapping[str, Any]) -> PageContent:
    """The page of a results.json."""
    rows, settings = results["rows"], results["settings"]
    command, torque = "python -m experiments.any_model", settings.get("rows") == "torque"
    if torque:
        command += f" --rows torque --times {settings['times']}"
    if settings["seed"]:
        command += f" --seed {settings['seed']}"
    sessions = counted(settings["sessions"], "session")
    told = [(_TORQUES if torque else _TEXT).format(sessions=sessions)]
    told += [_COMPOSED] * any(law_of(row["name"]) in COMPOSED for row in rows)
    return PageContent(
        "Any model, torques" if torque else "Any model",
        command,
        f"{counted(len(rows), 'machine')} of five public models, {sessions} of {20 if torque else 12} s each",
        (
            Section("", "\n\n".join(told), (_rates(rows),)),
            Section("Machines", "", (_machines(rows),)),
            *failures("Not traced", results),
        ),
    )


def _rates(rows: list[Row]) -> Table:
    faulty = [row for row in rows if row["name"] != CLEAN]
    clean = [row for row in rows if row["name"] == CLEAN]
    found = [row for row in faulty if told(row)]
    alone = [row for row in faulty if right(row) and len(row["named"]) == 1]
    near = [row for row in found if off(row) <= WITHIN]
    several = {
        "nothing named where nothing is": (clean, filter(right, clean)),
        "the fault named first, at its place": (faulty, filter(right, faulty)),
        "the fault named, and nothing else": (faulty, alone),
        "among those said to be not told apart from what is named first": (
            faulty,
            filter(undecided, faulty),
        ),
        f"strength within {100 * WITHIN:.0f} %": (found, near),
        "strength inside its 95 % interval": (found, filter(covered, found)),
    }
    lines = [(name, f"{len([*some])} of {len(of)}") for name, (of, some) in several.items()]
    seconds = f"{np.median([row['seconds'] for row in rows]):.0f} s"
    lines.append(("median of a trace's time on one core", seconds))
    return Table(("measure", "machines"), tuple(lines))


def _machines(rows: list[Row]) -> Table:
    columns = {
        "model": lambda row: spaced(row["model"]),
        "fault": lambda row: spaced(row["name"]),
        "strength": lambda row: ", ".join(f"{v:.3g}" for v in row["true"].values()),
        "named": lambda row: (
            ", ".join(map(spaced, row["named"]))
            or ("unexplained" if row["unexplained"] else "nothing")
        ),
        "strength found": told,
        "seconds": "{seconds:.0f}",
    }
    note = "In brackets, 95 % intervals; strengths in SI units, of a force along x, y, z."
    return Table.of(rows, columns, note)
