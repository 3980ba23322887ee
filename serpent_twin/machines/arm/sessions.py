"""Make session logs of the serpent arm logs of the machine that a machine.toml describes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.case import Case
from serpent_twin.machines.model import ModelRig, log_file
from serpent_twin.machines.model.clocks import PRIOR
from serpent_twin.machines.model.log_files import LogTables
from serpent_twin.machines.model.reading import read
from serpent_twin.machines.model.starts import with_starts
from serpent_twin.sessions import (
    FIELDS,
    Session,
    columns_of,
    read_folder,
    read_session,
    refuse_damaged,
)
from serpent_twin.sessions.session import turning
from serpent_twin.sim.prescribed_motion import STANDING
from serpent_twin.tables import DataTable
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_MOVES = 0.02
"""Share of rows in which a motor must turn to be one that moves"""
_LEAST = 30.0
"""Longest session at least [s], so that what is slow in cables and gears can show"""


@dataclass(frozen=True, eq=False)
class SessionLog(Log):
    """The log of a session, known again by what its motors read, whatever markers were put in."""

    @property
    def readings(self) -> Array:
        """Motor angles, velocities and loads of the rows in which a motor turns, as those of the session."""
        columns = {
            name: np.stack([self.columns[each] for each in FIELDS[name].columns], axis=1)
            for name in ("motor_position", "motor_velocity", "motor_load")
        }
        return turning(*columns.values())


@dataclass(frozen=True, eq=False)
class SessionRig(ModelRig):
    """A machine whose logs are checked sessions, with the metadata of their recorder."""

    def recorded(self, source: Path) -> list[Log]:
        """The sessions of a folder, or that of one file, checked."""
        return self.logs([read_session(source)] if source.is_file() else read_folder(source))

    def logs(self, sessions: Sequence[Session]) -> list[Log]:
        """The logs of sessions, several where the clock of one pauses; raises a `SerpentError` that quotes
        what is damaged.
        """
        refuse_damaged(list(sessions))
        logs = [log for session in sessions for log in self._logs(session)]
        return with_starts(self.described, logs)

    def open(self, training: Sequence[Log]) -> Case[Segments]:
        """First guesses; raises a `SerpentError` where all sessions are short, or no motor moves."""
        if max(float(log.time[-1] - log.time[0]) for log in training) < _LEAST:
            raise SerpentError(
                f"no session has {_LEAST:g} s without a gap in time. Record longer sessions."
            )
        speed = (
            np.abs(log.columns[each.velocity])
            for log in training
            for each in self.described.about.drive
        )
        if not any(np.mean(each > 2 * STANDING) > _MOVES for each in speed):
            raise SerpentError(
                "no motor moves in these logs, and a pose alone cannot distinguish an effect from a "
                "parameter. Record sessions in which the arm moves."
            )
        return super().open(training)

    def _logs(self, session: Session) -> Iterator[Log]:
        if not np.isfinite(session.marker).any():
            raise SerpentError(
                f"{session.path or session.name} has no markers, which show where the arm was. "
                "Add them: python -m serpent_twin.mocap merge --help."
            )
        table = DataTable(session.path or Path(session.name), columns_of(session))
        for log in log_file.read(self.described, LogTables(session.label, (table,))):
            about = log.metadata | session.metadata | {PRIOR: session.prior_runtime + log.time[0]}
            yield SessionLog(session.path, about, log.columns, log.name)


def open_arm(path: Path) -> SessionRig:
    """The serpent arm, as a machine.toml describes it."""
    return SessionRig(read(path))
