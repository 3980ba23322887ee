"""Merge a take's markers into session logs."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tyro.conf import Positional, arg

from serpent_twin import stored
from serpent_twin.arm.geometry import N_JOINTS, joint_from_motor
from serpent_twin.arrays import Array
from serpent_twin.command_line.options import ABSENT, Checked, when
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import Rigid, fit_rigid
from serpent_twin.hardware.motive import Take, read_take
from serpent_twin.runs.provenance import file_hash
from serpent_twin.sessions import (
    Session,
    agree,
    marker_fit,
    read_session,
    refuse_odd_markers,
    say_unread,
    session_files,
    write_session,
)
from serpent_twin.sessions.film import Film, sampled
from serpent_twin.sessions.markers import FEWEST
from serpent_twin.sessions.markers_together import DOUBTED, HALVED
from serpent_twin.sessions.match import Match, match
from serpent_twin.stored import many, within

BASE_FIT = 0.010  # m rms: markers glued to the base are measured better than this
_Place = Annotated[tuple[Annotated[float, within(-100.0, 100.0, "m")], ...], many(3)]
OF_CAMERAS = ("camera_time", "marker_age")  # columns about the live markers

HEADING = (
    f"{'session':<12} {'offset, s':>12} {'± ms':>6} {'drift, ppm':>11} {'± ppm':>6} "
    f"{'residual, mm':>13} {'rows with all markers':>22}"
)


@dataclass(frozen=True)
class Merge(Checked):
    """Fill the markers of session logs from a take that Motive exported.

    Each session is found in the take by the motion that its motor angles must have caused. New logs
    are written to --out; the logs given stay as they are. A session that the take does not hold, that
    fits at more than one place, or of which a marker is not where the motors put it, is refused by
    name, and the command exits 1.
    """

    logs: Annotated[Positional[Path], arg(metavar="LOGS")]
    """A session log, or a folder with session logs."""
    take: Annotated[Positional[Path], arg(metavar="TAKE.csv")]
    """CSV of Motive: File → Export Tracking Data, with Markers switched on."""
    out: Path | None = None
    """Folder for the new logs; made if it does not exist. Without: beside LOGS, named …_merged."""
    labels: tuple[str, ...] = ()
    """The take's names of markers 1 … 9, base to tip. Without: names that end in 1 … 9, else found
    by their motion."""
    frame: Path | None = None
    """Cameras' frame to base frame, as `frame` writes it. Without it and --base-markers, the base frame
    is fitted to the nominal twin's markers, which hides a constant error of the twin."""
    base_markers: Annotated[Path | None, when(frame=ABSENT)] = None
    """JSON of markers glued to the base, name: [x, y, z] in the base frame [m]; at least three."""
    replace: bool = False
    """Put the take's markers in place of those that a log holds already, such as live ones."""

    @property
    def folder(self) -> Path:
        """Where the new logs go."""
        logs = self.logs if self.logs.is_dir() else self.logs.parent
        return self.out or logs.absolute().with_name(logs.absolute().name + "_merged")


def merge(config: Merge) -> Iterator[tuple[Session, str]]:
    """Write the merged sessions one by one; yields each with its line of the table.

    Raises a `SerpentError` in the end that names every session refused, and why.
    """
    take = read_take(config.take)
    film, given = Film.of(take), _given_frame(config, take)
    refused, used = [], []
    for path in _files(config):
        try:
            session = read_session(path)
            _refuse_replacing(config, session)
            found = _found(session, film, take, config.labels)
            used = _not_twice(session, found, used)
            merged = _merged(session, take, found, given)
            refuse_odd_markers(merged)
            agree.refuse_another_arm(found.predicted, merged.marker)
            write_session(config.folder / path.name, merged)
            yield merged, line(merged)
        except SerpentError as error:
            refused.append(f"{path.name}: {error}")
    if refused:
        raise SerpentError(f"{len(refused)} not merged. " + " ".join(refused))


def line(session: Session) -> str:
    """One line of the table, under `HEADING`."""
    m = session.metadata["mocap"]
    whole = np.isfinite(session.marker).all(axis=(-1, -2)).mean()
    return (
        f"{session.name:<12} {m['offset_s']:>12.4f} {1e3 * m['offset_std_s']:>6.1f} "
        f"{m['drift_ppm']:>11.1f} {m['drift_std_ppm']:>6.1f} {1e3 * m['residual_rms_m']:>13.2f} "
        f"{100 * whole:>20.2f} %"
    )


def _files(config: Merge) -> list[Path]:
    if not config.logs.exists():
        raise SerpentError(
            f"There is no {config.logs}. Name a session log or a folder with session logs."
        )
    files = session_files(config.logs) if config.logs.is_dir() else [config.logs]
    if config.logs.is_dir():
        say_unread(config.logs)
    if not files:
        raise SerpentError(f"There is no session_NN.parquet in {config.logs}.")
    taken = [path.name for path in files if (config.folder / path.name).exists()]
    if taken:
        raise SerpentError(
            f"{config.folder} holds {', '.join(taken)} already, which is kept: move it away, or name "
            "another --out."
        )
    config.folder.mkdir(parents=True, exist_ok=True)
    return files


def _refuse_replacing(config: Merge, session: Session) -> None:
    held = float(np.isfinite(session.marker).all(axis=-1).any(axis=-1).mean())
    if held and not config.replace:
        raise SerpentError(
            f"it holds markers already, in {held:.0%} of its rows "
            f"(source: {session.metadata.get('markers', 'not said')}). Leave it out, or give --replace "
            "to put the take's in their place."
        )


def _found(session: Session, film: Film, take: Take, labels: tuple[str, ...]) -> Match:
    from serpent_twin.sim.twin import replay_motors

    predicted = replay_motors(session.time, session.motor_position).marker
    return match(session.time, predicted, film, take.names, labels)


def _not_twice(
    session: Session, found: Match, used: list[tuple[str, Array]]
) -> list[tuple[str, Array]]:
    """The parts of the take in use, with this session's; raises if two sessions claim one part."""
    span = found.clock.camera_time(session.time[[0, -1]])
    for name, other in used:
        if span[0] < other[1] and other[0] < span[1]:
            raise SerpentError(
                f"its place in the take, {span[0]:.1f} … {span[1]:.1f} s, overlaps that of {name}. "
                "One of the two is from another take; merge them one by one."
            )
    return [*used, (session.name, span)]


def _merged(session: Session, take: Take, found: Match, given: tuple[Rigid, str] | None) -> Session:
    """The session with markers at its time stamps, and what was found out in its metadata."""
    clock, filmed = found.clock, sampled(found.film, found.clock.camera_time(session.time))
    rigid, source = given or _own_frame(session, filmed, found.rigid)
    agree.refuse_frame(rigid, source, found.rigid, filmed)
    marker = rigid.apply(filmed)
    seen = np.isfinite(marker).all(axis=-1)
    shift = np.linalg.norm(marker - found.rigid.apply(filmed), axis=-1)
    names = [{take.names[c]: n for c, n in giver.items()} for giver in found.givers]
    facts: dict[str, Any] = {
        "offset_s": clock.offset,
        "offset_std_s": clock.offset_std,
        "drift_ppm": 1e6 * clock.drift,
        "drift_std_ppm": 1e6 * clock.drift_std,
        "residual_rms_m": agree.rms(((marker - found.predicted) ** 2).sum(axis=-1)),
        "fit_residual_rms_m": found.rigid.residual,
        "explained": found.explained,
        "explained_second_best": found.runner_up,
        "labels": [next(iter(name), "") for name in names],
        "frames_by_label": names,
        "frame_source": source,
        "frame_residual_rms_m": rigid.residual,
        "frame_from_fit_m": float(shift[seen].mean()) if seen.any() else None,
        "camera_to_base": {
            "rotation": rigid.rotation.tolist(),
            "translation_m": rigid.translation.tolist(),
        },
        "rows_with_markers": float(np.logical_or.reduce(seen, axis=1).mean()),
        "rows_with_all_markers": float(np.logical_and.reduce(seen, axis=1).mean()),
        "take": take.path.name,
        "take_sha256": file_hash(take.path),
    }
    metadata = session.metadata | {"markers": "motive", "mocap": facts}
    columns = {name: each for name, each in session.columns.items() if name not in OF_CAMERAS}
    return replace(session, metadata=metadata, columns=columns | {"marker": marker})


def _own_frame(session: Session, filmed: Array, rigid: Rigid) -> tuple[Rigid, str]:
    """The frame fitted to the twin's markers; where the arm's own joints contradict it, fitted to these.

    `filmed` (T, 9, 3) are the session's markers in the cameras' frame [m].
    """
    seen = np.flatnonzero(np.isfinite(filmed).all(axis=-1).sum(axis=1) >= FEWEST)
    if len(seen) == 0:
        return rigid, "fitted on the arm's markers"
    rows = seen[np.linspace(0, len(seen) - 1, min(len(seen), marker_fit.ROWS)).round().astype(int)]
    start = joint_from_motor(session.motor_position[rows, :N_JOINTS])
    by_twin = marker_fit.fit(filmed[rows], start, to_base=rigid)
    if by_twin.misplaced <= DOUBTED:
        return rigid, "fitted on the arm's markers"
    by_joints = marker_fit.fit(filmed[rows], start, frame=True, to_base=rigid)
    if by_joints.misplaced > HALVED * by_twin.misplaced:
        return rigid, "fitted on the arm's markers"
    return by_joints.to_base, "fitted on the arm's joints"


def _given_frame(config: Merge, take: Take) -> tuple[Rigid, str] | None:
    if config.frame:
        return Rigid.load(config.frame), f"frame file {config.frame.name}"
    if config.base_markers:
        return _from_base_markers(config.base_markers, take), "markers on the base"
    return None


def _from_base_markers(path: Path, take: Take) -> Rigid:
    """Cameras to base from markers that stand still on the base: their middle places in the take."""
    example = 'Give name: [x, y, z] in metres, such as {"base:1": [0.0, 0.03, 0.02]}.'
    found = stored.read_json(path, dict[str, _Place], example)
    places = {name: np.array(place) for name, place in found.items()}
    missing = [name for name in places if name not in take.names]
    if missing:
        raise SerpentError(
            f"{path} names {', '.join(missing)}, which the take lacks. "
            f"It has {', '.join(take.names)}."
        )
    columns = [take.names.index(name) for name in places]
    shown = np.isfinite(take.position[:, columns]).all(axis=-1).any(axis=0)
    if not shown.all():
        hidden = [list(places)[n] for n in np.flatnonzero(~shown)]
        raise SerpentError(
            f"{path} names {', '.join(hidden)}, which no frame of the take shows. Leave it out, or "
            "make it visible and record again."
        )
    seen, place = np.nanmedian(take.position[:, columns], axis=0), np.array(list(places.values()))
    rigid = fit_rigid(seen, place)
    if not rigid.residual <= BASE_FIT:
        left = np.linalg.norm(rigid.apply(seen) - place, axis=-1)
        sizes = ", ".join(f"{n} {1e3 * far:.0f}" for n, far in zip(places, left, strict=True))
        raise SerpentError(
            f"{path}: the base's markers are {1e3 * rigid.residual:.0f} mm rms from where the file has "
            f"them, more than {1e3 * BASE_FIT:.0f} mm (by marker, in mm: {sizes}). Check the "
            "coordinates, which are in metres, and the names."
        )
    return rigid
