"""Write, read, check and recover session logs: `python -m serpent_twin.log --help`."""

from serpent_twin.sessions.check import examine, refuse_damaged, refuse_odd_markers
from serpent_twin.sessions.finding import Finding
from serpent_twin.sessions.journal import Journal
from serpent_twin.sessions.parquet import (
    read_folder,
    read_session,
    say_unread,
    session_files,
    write_session,
)
from serpent_twin.sessions.recovery import recover
from serpent_twin.sessions.session import (
    COLUMNS,
    FIELDS,
    SCHEMA_VERSION,
    UNITS,
    Session,
    columns_of,
)
from serpent_twin.sessions.stream import read_journal

__all__ = [
    "COLUMNS",
    "FIELDS",
    "SCHEMA_VERSION",
    "UNITS",
    "Finding",
    "Journal",
    "Session",
    "columns_of",
    "examine",
    "read_folder",
    "read_journal",
    "read_session",
    "recover",
    "refuse_damaged",
    "refuse_odd_markers",
    "say_unread",
    "session_files",
    "write_session",
]
