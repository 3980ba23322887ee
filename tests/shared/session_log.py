"""A made-up session, as a log and as a journal, and a disk that is full."""

import resource
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from serpent_twin import sessions
from serpent_twin.arm.geometry import joint_from_motor, markers

METADATA = {"backend": "sim", "arm": "nominal", "session": 1, "rate_hz": 4.0, "seed": 7}


def make_session(rows: int = 60, seed: int = 0, **metadata: object) -> sessions.Session:
    """A smooth session with noise in every column; marker 3 is lost in rows 5 … 7."""
    rng = np.random.default_rng(seed)
    clock = np.arange(rows) / 4
    position = 2 * np.sin(0.3 * clock[:, None] + np.arange(10)) + rng.normal(0, 1e-3, (rows, 10))
    marker = markers(joint_from_motor(position[:, :9])) + rng.normal(0, 1e-4, (rows, 9, 3))
    marker[5:8, 2] = np.nan
    return sessions.Session(
        None,
        {"schema_version": 1} | METADATA | metadata,
        {
            "time": clock,
            "motor_position": position,
            "motor_velocity": 0.6 * np.cos(0.3 * clock[:, None] + np.arange(10)),
            "motor_load": rng.uniform(-0.2, 0.2, (rows, 10)),
            "motor_velocity_command": rng.normal(0, 0.5, (rows, 10)),
            "joint_target": rng.uniform(0, 0.3, (rows, 9)),
            "marker": marker,
        },
    )


def rows_of(session: sessions.Session) -> list[dict]:
    return [
        {name: getattr(session, name)[t] for name in sessions.FIELDS} for t in range(len(session))
    ]


def assert_same(a: sessions.Session, b: sessions.Session) -> None:
    mine, other = sessions.columns_of(a), sessions.columns_of(b)
    assert mine.keys() == other.keys()
    for name in mine:
        np.testing.assert_array_equal(mine[name], other[name])


def write_journal(folder: Path, session: sessions.Session) -> tuple[Path, list[int]]:
    """An unsealed journal of a session, and its size after the header and after each row."""
    with sessions.Journal(folder / "session_01.journal", METADATA) as journal:
        sizes = [journal.path.stat().st_size]
        for row in rows_of(session):
            journal.append(row)
            sizes.append(journal.path.stat().st_size)
    return journal.path, sizes


@contextmanager
def full_disk(size):
    """No file of this process grows beyond a size meanwhile, as on a full disk; the log that the
    tests' own output goes to must not be caught by it.
    """
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
