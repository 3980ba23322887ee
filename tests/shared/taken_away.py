"""Simulate twins as a trace does and as a plain MuJoCo program does that has their files alone."""

from dataclasses import dataclass
from pathlib import Path

import moving_models
import mujoco
import numpy as np
import pulled_lever

from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.drives import commands
from serpent_twin.machines.model.motion import RowStates
from serpent_twin.tables.segments import Segments

SECOND = 51  # rows of a second and a bit at the rates of these logs


@dataclass(frozen=True)
class Taken:
    """A machine, its segments, and the folder that its twins are written into."""

    case: Case[Segments]
    pieces: Segments
    folder: Path

    def twin(self, lacks=(), declared=()) -> ParameterVector:
        """The nominal twin with effects, and with some coordinates of the fit."""
        values = {name: np.atleast_1d(np.array(v, float)) for name, v in dict(lacks).items()}
        found = ParameterVector.nominal(self.case.declared, values)
        names = [each.name for each in self.case.declared]
        for name, value in dict(declared).items():
            found.declared[names.index(name)] = value
        return found

    def write(self, twin: ParameterVector) -> Path:
        """Write twin.json and twin.xml; returns the path of twin.json."""
        path = self.folder / "twin.json"
        self.case.write(twin, path, {})
        return path

    def by_trace(self, twin: ParameterVector) -> RowStates:
        """The states of a trace's own simulation in each row."""
        return self.case.machine._in_motion([twin]).motion(self.pieces).recorded()

    def told(self, rows: int) -> np.ndarray:
        """What the log of the first segment tells the actuators."""
        return commands(self.case.machine.described, self.pieces)[0, :rows]


def arm(folder: Path) -> Taken:
    """A two-joint arm with servos."""
    path = moving_models.machine(folder / "arm")
    return _opened(path, moving_models.log(folder / "log.csv", 3))


def lever(folder: Path) -> Taken:
    """A lever that a servo pulls by a cable."""
    path = pulled_lever.machine(folder / "lever")
    return _opened(path, pulled_lever.log(folder / "log.csv", 3))


def _opened(path: Path, log: Path) -> Taken:
    rig = open_machine(path)
    recordings = rig.read(log)
    case = rig.open(recordings)
    return Taken(case, case.pieces(recordings), path.parent)


def begun(path: Path, states: RowStates, told) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A twin.xml as it is, where and in which time steps a trace begins."""
    model = mujoco.MjModel.from_xml_path(str(path.with_suffix(".xml")))
    data, count = mujoco.MjData(model), told.shape[1]
    model.opt.timestep = states.step[0]
    data.qpos[:], data.qvel[:] = states.pose[0, 0], states.rate[0, 0]
    data.ctrl[:count] = told[0]
    for n in range(count):
        if model.actuator_actnum[n]:
            data.act[model.actuator_actadr[n]] = told[0, n]
    return model, data


def stepped(model, data, period: float, told) -> np.ndarray:
    """Poses in each row, told as a trace tells: the mean of two rows in the step that is half of each."""
    poses, count = [data.qpos.copy()], told.shape[1]
    parts = round(period / model.opt.timestep)
    for t in range(len(told) - 1):
        for k in range(parts):
            data.ctrl[:count] = told[t] if k else (told[max(t - 1, 0)] + told[t]) / 2
            mujoco.mj_step(model, data)
        poses.append(data.qpos.copy())
    return np.array(poses)
