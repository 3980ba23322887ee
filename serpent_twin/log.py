"""Look into logs, check them, recover a recording that was cut off, or bring logs in and take them out."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tyro.conf import Positional

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.command_line.program import as_started
from serpent_twin.errors import SerpentError
from serpent_twin.exchange import imported_log
from serpent_twin.exchange.exporting import export
from serpent_twin.exchange.importing import import_logs, machine_of
from serpent_twin.exchange.writing import summary
from serpent_twin.numerals import counted
from serpent_twin.runs.provenance import file_hash
from serpent_twin.sessions.check import examine
from serpent_twin.sessions.finding import Finding
from serpent_twin.sessions.parquet import read_session, say_unread, session_files, unread
from serpent_twin.sessions.recovery import recover
from serpent_twin.sessions.session import Session

_SHOWN_PER_SESSION = {"session", "rows", "complete", "recovered", "bytes_dropped"}


def recover_command(path: Positional[Path]) -> None:
    """Save the whole rows of cut-off recordings (session_NN.journal) as session_NN.parquet.

    Rows are taken up to the first damaged one. A damaged journal is kept as *.journal.torn; nothing
    that exists is overwritten.

    Args:
        path: A journal, or a folder with journals.
    """
    recovered = recover(path)
    for session in map(read_session, recovered):
        dropped = session.metadata.get("bytes_dropped", 0)
        print(
            f"{session.path}: {counted(len(session), 'row')} recovered, "
            f"{counted(dropped, 'damaged byte')} dropped"
        )
    if not recovered:
        print(f"{path}: nothing to recover")
    folder = path if path.is_dir() else path.parent
    if session_files(folder):
        next_step.say(next_step.step("look", path=folder))


def info_command(path: Positional[Path]) -> None:
    """Say what logs hold: rows, duration, rate, lost markers, where they come from.

    Of an imported log: its columns, with their units and ranges.

    Args:
        path: A log, or a folder with logs.
    """
    files, others = _files(path)
    for each in others:
        print(imported_log.described(imported_log.read(each)))
    sessions = [read_session(file) for file in files]
    if sessions:
        _sessions_info(path, sessions)
    if not any(_is_damaged(examine(each)) for each in sessions):
        _say_next(path)


def _sessions_info(path: Path, sessions: list[Session]) -> None:
    common = _common(sessions)
    print(f"{path}: {counted(len(sessions), 'session')}")
    for key, value in common.items():
        print(f"  {key}: {_short(value)}")
    print(
        f"  {'session':<12} {'rows':>7} {'time [s]':>9} {'rate [Hz]':>9} {'lost markers [%]':>16}  sha256"
    )
    for session in sessions:
        print(_line(session))
        for key in session.metadata.keys() - common.keys() - _SHOWN_PER_SESSION:
            print(f"    {key}: {_short(session.metadata[key])}")
    for journal in sorted(path.glob("*.journal")) if path.is_dir() else []:
        print(f"  {journal.name}: a recording that is under way or cut off; see `recover`")


def check_command(path: Positional[Path]) -> None:
    """Look for damage in logs: lost turns, stuck motors, lost markers, missed deadlines.

    Imported logs are searched for odd clocks and for unknown, constant or equal columns. Prints one sentence
    per finding, with the rows (from 0). Exits 1 if a finding is an error: a file that cannot be read, a motor
    value that is no number, a motor that lost its turn count. Exits 2 if there is nothing to look at.

    Args:
        path: A log, or a folder with logs.
    """
    files, others = _files(path)
    spoiled = [file.name for file in files if not _report(file)]
    spoiled += [file.name for file in others if not _report_other(file)]
    if spoiled:
        share = (
            f"{len(spoiled)} of {counted(len(files) + len(others), 'log' if others else 'session')}"
        )
        cli.fail(f"{path}: {share} cannot be trusted: {', '.join(spoiled)}.")
    _say_next(path)


def import_command(
    files: Positional[tuple[Path, ...]], map: Path, out: Path, machine: Path | None = None
) -> None:
    """Make logs of recordings of other tools: tables, MCAP, ROS bags, LeRobot data sets.

    Units, frames, rates and clocks are as the map says. OUT gets NAME.parquet of each recording, in SI units,
    which a machine.toml names by its columns; and imported.json, which says what was taken and what was left.
    Exit status 0 for logs, 2 for an error.

    Args:
        files: Recordings: files, or folders of them.
        map: A map.toml, which says which fields become which columns.
        out: Folder for the logs; made if it does not exist.
        machine: The machine.toml whose drives are commands. Without: one beside the map or OUT, if there is.
    """
    machine = machine_of(machine, map, out)
    found = import_logs(files, map, out, machine)
    print(summary(found))
    if machine:
        print(f"{machine} says which columns are commands.")
    print(f"{out}: {counted(len(found), 'log')}.")
    step = next_step.step("look", path=out)
    if machine:
        step = next_step.step("check", machine=machine, logs=out)
    next_step.say(step)


def export_command(path: Positional[Path], out: Path) -> None:
    """Write a log as CSV, or as MCAP with a message of JSON a row.

    Args:
        path: A log, .parquet.
        out: The file to write, .csv or .mcap.
    """
    print(f"{out}: {counted(export(path, out), 'row')}.")


def _say_next(path: Path) -> None:
    """Suggest what follows a look at logs: train on a folder, here, if they are enough; else replay one."""
    here = Path()
    step = next_step.after_logs if path.is_dir() else next_step.replay
    next_step.say(step(path, here))


def _is_damaged(findings: Sequence[Finding]) -> bool:
    return any(finding.level == "error" for finding in findings)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 160 else f"{text[:150]} … ({counted(len(text), 'character')})"


def _report(file: Path) -> bool:
    """Print the findings of one file; false if one of them is an error."""
    try:
        session = read_session(file)
    except SerpentError as error:
        print(f"{file.name}: cannot be used\n  error: {error}")
        return False
    return _verdict(file, len(session), examine(session))


def _report_other(file: Path) -> bool:
    """Print the findings of an imported log; false if one of them is an error."""
    log = imported_log.read(file)
    return _verdict(file, len(log), imported_log.examined(log))


def _verdict(file: Path, rows: int, findings: list[Finding]) -> bool:
    damaged = _is_damaged(findings)
    usable = any(finding.level == "warning" for finding in findings)
    verdict = "damaged" if damaged else "usable" if usable else "sound"
    print(f"{file.name}: {counted(rows, 'row')}, {verdict}")
    for finding in findings:
        print(f"  {finding.level}: {as_started(finding.text)}")
    return not damaged


def _files(path: Path) -> tuple[list[Path], list[Path]]:
    """Session logs, and logs of other machines."""
    if not path.exists():
        raise SerpentError(f"There is no {path}. Name a log or a folder with logs.")
    if not path.is_dir():
        return ([], [path]) if imported_log.is_other(path) else ([path], [])
    files, others = (
        session_files(path),
        [each for each in unread(path) if imported_log.is_other(each)],
    )
    if files and not others:
        say_unread(path, print)
    if not files and not others:
        raise SerpentError(
            f"There is no session_NN.parquet in {path}, nor a log that `log import` wrote. Name another "
            "folder."
        )
    return files, others


def _common(sessions: list[Session]) -> dict[str, object]:
    """Metadata that all sessions share."""
    first = sessions[0].metadata
    shared = [k for k in first if all(s.metadata.get(k) == first[k] for s in sessions)]
    return {key: first[key] for key in shared if key not in _SHOWN_PER_SESSION}


def _line(session: Session) -> str:
    duration = session.time[-1] - session.time[0]
    lost = 100 * np.isnan(session.marker).any(axis=-1).mean()
    state = "  recovered" if session.metadata.get("recovered") else ""
    hashed = file_hash(session.path) if session.path else ""
    return (
        f"  {session.name:<12} {len(session):>7} {duration:>9.2f} {session.rate_hz:>9g} "
        f"{lost:>16.2f}  {hashed}{state}"
    )


if __name__ == "__main__":
    cli.run(
        {
            "recover": recover_command,
            "info": info_command,
            "check": check_command,
            "import": import_command,
            "export": export_command,
        },
        error_status=2,
    )
