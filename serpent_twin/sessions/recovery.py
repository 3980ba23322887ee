"""Make a session log of a recording that was cut off."""

import fcntl
import logging
from pathlib import Path

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.runs.files import sync_folder
from serpent_twin.sessions.parquet import read_session
from serpent_twin.sessions.session import columns_of
from serpent_twin.sessions.stream import JournalContent, read_journal

_log = logging.getLogger(__name__)


def recover(path: Path | str) -> list[Path]:
    """Turn the journal at `path`, or all in the folder `path`, into session logs; return these.

    A recovered log says `"recovered": true, "complete": false`. A journal with damage, or without a
    whole row, is kept as *.journal.torn. Nothing that exists is overwritten.
    """
    path = Path(path)
    if path.is_dir():
        found = [_recover_one(journal) for journal in sorted(path.glob("*.journal"))]
    elif path.is_file() and path.suffix == ".journal":
        found = [_recover_one(path)]
    else:
        raise SerpentError(f"{path} is neither a folder nor a .journal file. Name one of these.")
    return [sealed for sealed in found if sealed]


def _recover_one(journal: Path) -> Path | None:
    _refuse_live(journal)
    content, sealed = read_journal(journal), journal.with_suffix(".parquet")
    if not len(content.rows):
        _log.warning(f"{journal} holds no whole row; it is kept as {_set_aside(journal)}.")
        return None
    if sealed.exists():
        _refuse_different(sealed, journal, content)  # else killed between sealing and deleting
    else:
        dropped = {"bytes_dropped": content.bytes_dropped}
        content.write(sealed, {"recovered": True, "complete": False} | dropped)
    if content.bytes_dropped:
        _set_aside(journal)
    else:
        journal.unlink()
    sync_folder(journal.parent)
    return sealed


def _set_aside(journal: Path) -> Path:
    number, torn = 1, journal.with_name(journal.name + ".torn")
    while torn.exists():
        number += 1
        torn = journal.with_name(f"{journal.name}.torn{number}")
    return journal.rename(torn)


def _refuse_live(journal: Path) -> None:
    with journal.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise SerpentError(
                f"{journal} is being recorded right now. Wait for that program to end, or stop it."
            ) from error


def _refuse_different(sealed: Path, journal: Path, content: JournalContent) -> None:
    present = np.stack(list(columns_of(read_session(sealed)).values()), axis=-1)
    if not np.array_equal(present, content.rows, equal_nan=True):
        raise SerpentError(
            f"{sealed} exists already and holds other rows than {journal}. "
            "Both are kept: move one of them away, then recover again."
        )
