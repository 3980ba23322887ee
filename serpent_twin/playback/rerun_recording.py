"""Draw a session in rerun."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from scipy.spatial.transform import Rotation

from serpent_twin import sessions
from serpent_twin.arm import meshes, routing
from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS, Arm, link_frames, middles
from serpent_twin.arm.mjcf import STRANDS
from serpent_twin.arrays import Array, known_mean
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.playback.marker_looks import (
    CORRECTED,
    ESTIMATED,
    MEASURED,
    NOMINAL,
    TWIN,
    Colour,
    EstimatedMarkers,
    Rows,
)
from serpent_twin.playback.rerun_colours import full_tension, hue, tension_colour
from serpent_twin.playback.rerun_layout import KEY, LOADS, TENSIONS, blueprint, key, short
from serpent_twin.runs.files import replacing
from serpent_twin.sim.pushes import COLUMNS
from serpent_twin.sim.response import Response

_PUSH = (255, 230, 60)
ARROW = 0.1
"""Length of a force's arrow [m/N]"""


@dataclass(frozen=True)
class Overlay:
    """A twin that is drawn over the measured arm."""

    name: str
    """Name of its entities"""
    look: str
    """Its colour in words"""
    colour: Colour
    """0 … 255"""
    moved: Response
    """What it did"""


def write(
    out: Path,
    session: sessions.Session,
    moved: Response,
    guess: EstimatedMarkers | None = None,
    identity: str | None = None,
    arm: Arm = ARM,
    corrected: Response | None = None,
) -> None:
    """Write the recording of a session [T rows] to a file, which appears when it is whole.

    `moved` is what the nominal twin did. Where there is a corrected one, pose and tensions are its,
    and lines through the markers lay measured arm and both twins over each other.
    """
    stream = rr.RecordingStream("serpent_twin", recording_id=identity)
    with written(out, stream, blueprint(session.name)):
        _draw(stream, session, moved, guess, arm, corrected)


def _draw(
    stream: rr.RecordingStream,
    session: sessions.Session,
    moved: Response,
    guess: EstimatedMarkers | None,
    arm: Arm,
    corrected: Response | None,
) -> None:
    stream.send_recording_name(session.name)
    writer = Writer(stream, session.time, arm)
    posed, rows = corrected or moved, np.arange(len(session))
    twins = [Overlay("twin", "grey", TWIN, moved)]
    if corrected:
        twins = [
            Overlay("nominal_twin", "red", NOMINAL, moved),
            Overlay("corrected_twin", "blue", CORRECTED, corrected),
        ]
        writer.chain("measured", session.marker, MEASURED)
    writer.about(session, twins, guess)
    writer.shapes()
    writer.motion(session.motor_position, posed.joint_angle, posed.jaw_angle)
    writer.cables(posed.tension)
    if COLUMNS[0] in session.extra:
        writer.push(session, posed.joint_angle)
    writer.markers("measured", session.marker, rows, MEASURED, 0.0050)
    for each in twins:
        writer.markers(each.name, each.moved.marker, rows, each.colour, 0.0030)
        writer.error(each.name, each.moved.marker - session.marker, rows, each.colour)
        if corrected:
            writer.chain(each.name, each.moved.marker, each.colour)
    if guess:
        writer.markers("estimated", guess.marker, guess.row, ESTIMATED, 0.0048)
        writer.error(guess.name, guess.marker - session.marker[guess.row], guess.row, ESTIMATED)
    for j in range(N_MOTORS):
        load = 100 * session.motor_load[:, j]
        writer.curve(f"{LOADS}/motor{j + 1}", load, hue(j), name=f"motor {j + 1}")
    for n, name in enumerate(STRANDS):
        writer.curve(f"{TENSIONS}/{name}", posed.tension[:, n], hue(n // 2), name=short(name))


def require_writable(out: Path) -> None:
    """Raise `OSError` where no recording can be written, before it is computed."""
    out.parent.mkdir(parents=True, exist_ok=True)
    part = out.with_name(out.name + ".partial")
    part.touch()
    part.unlink()


@contextmanager
def written(out: Path, stream: rr.RecordingStream, layout: rrb.Blueprint) -> Iterator[None]:
    """Write what a stream is sent to a file, which appears when it is whole."""
    require_writable(out)
    try:
        with replacing(out) as part:
            stream.save(part, default_blueprint=layout)
            yield
            stream.flush()
            stream.disconnect()
    except RuntimeError as error:  # rerun's writer thread died, most likely of a full disk
        raise SerpentError(
            f"{out} could not be written whole. Make room on the disk, then run it again."
        ) from error


@dataclass(frozen=True)
class Writer:
    """Puts columns of a session's rows on both timelines of a recording."""

    recording: rr.RecordingStream
    """What is written to"""
    time: Array
    """Time of the rows [s], (T,)"""
    arm: Arm = ARM
    """The arm whose shapes are drawn"""
    first: int = 0
    """Row of the session at which these begin"""

    def about(
        self, session: sessions.Session, twins: list[Overlay], guess: EstimatedMarkers | None
    ) -> None:
        """A page that describes what is shown."""
        last = twins[-1]
        lines = [
            f"### {session.metadata.get('arm')}, {session.name}",
            f"{counted(len(session), 'row')} at {session.rate_hz:g} Hz, "
            f"backend `{session.metadata.get('backend')}`.",
            f"Pose and tensions: the {last.name.replace('_', ' ')}, driven by the measured motor angles.",
            *(_distance(t, session.marker) for t in twins),
            guess.seen if guess else "",
        ]
        page = rr.TextDocument("\n\n".join(filter(None, lines)), media_type="text/markdown")
        self.recording.log("about", page, static=True)
        looks = {"green": "marker, as the cameras measured it"}
        looks |= {t.look: f"marker of the {t.name.replace('_', ' ')}" for t in twins}
        looks |= {"orange": f"marker, as `{guess.name}` estimates it"} if guess else {}
        looks |= (
            {"yellow arrow": "known force, 10 cm a newton"} if COLUMNS[0] in session.extra else {}
        )
        looks["blue … red cable"] = f"slack … {full_tension(last.moved.tension):.1f} N or more"
        self.recording.log(KEY, key(looks), static=True)
        self.recording.log("/", rr.ViewCoordinates.DLF, static=True)  # +x hangs down

    def shapes(self) -> None:
        """All meshes, each under its body."""
        for piece in meshes.parts(self.arm):
            flat = piece.mesh.triangles.reshape(-1, 3)  # unshared corners keep edges sharp
            mesh = rr.Mesh3D(
                vertex_positions=flat,
                vertex_normals=np.repeat(piece.mesh.face_normals, 3, axis=0),
                albedo_factor=piece.rgba,
            )
            self.recording.log(f"arm/{piece.body}/{piece.name}", mesh, static=True)

    def motion(self, motor: Array, joint: Array, jaw: Array) -> None:
        """Poses of horns, links and jaw in the base frame, at their angles [rad]."""
        turn = np.zeros((len(self.time), 3))
        for j in range(N_MOTORS):
            turn[:, 2] = motor[:, j]
            place = np.broadcast_to(self.arm.motor_place[j], turn.shape)
            self._pose(f"arm/motor{j + 1}", place, Rotation.from_rotvec(turn))
        origin, rotation = link_frames(joint, self.arm)
        for i in range(N_JOINTS):
            turned = Rotation.from_matrix(rotation[:, i])
            self._pose(f"arm/link{i + 1}", origin[:, i], turned)
        hinge = origin[:, -1] + rotation[:, -1] @ [self.arm.jaw_joint, 0.0, 0.0]
        opened = Rotation.from_rotvec(np.outer(jaw, [0.0, 1.0, 0.0]))
        self._pose("arm/jaw", hinge, Rotation.from_matrix(rotation[:, -1]) * opened)

    def cables(self, tension: Array) -> None:
        """Strands, fixed to the bodies they pass; only their colours change."""
        colours = tension_colour(tension, full_tension(tension))
        for n, name in enumerate(STRANDS):
            motor, side = n // 2, routing.SIDES[name.split("_")[1]]
            for body, line in routing.pieces(self.arm, motor, side).items():
                path = f"arm/{body}/{name}"
                shape = rr.LineStrips3D([line], radii=rr.Radius.ui_points(0.7))
                self.recording.log(path, shape, static=True)
                self.send(path, rr.LineStrips3D.columns(colors=colours[:, n]))

    def push(self, session: sessions.Session, joint: Array) -> None:
        """An arrow for the known force on a link, from the middle of the link at the joints' angles [rad]."""
        link, *force = (session.extra[name] for name in COLUMNS)
        pushed = link > 0
        row = np.flatnonzero(pushed)
        which = link[row].astype(int) - 1
        place = middles(joint[row], self.arm)[np.arange(len(row)), which]
        look = rr.Arrows3D.from_fields(colors=[_PUSH], radii=0.003)
        self.recording.log("arm/push", look, static=True)
        arrows = rr.Arrows3D.columns(origins=place, vectors=ARROW * np.stack(force, axis=-1)[row])
        self.send("arm/push", arrows.partition(pushed.astype(int)))

    def markers(self, kind: str, marker: Array, row: Rows, colour: Colour, radius: float) -> None:
        """Marker positions [m], (N, 9, 3), at some rows; nothing is shown where one was lost."""
        for i in range(N_JOINTS):
            path, seen = f"markers/{kind}/marker{i + 1}", np.isfinite(marker[:, i]).all(axis=-1)
            self.recording.log(
                path, rr.Points3D.from_fields(colors=[colour], radii=[radius]), static=True
            )
            points = rr.Points3D.columns(positions=marker[seen, i])
            self.send(path, points.partition(seen.astype(int)), row)

    def chain(self, kind: str, marker: Array, colour: Colour) -> None:
        """A line from the base through the markers that are seen, (T, 9, 3)."""
        path, radius = f"markers/{kind}/chain", rr.Radius.ui_points(2.0)
        look = rr.LineStrips3D.from_fields(colors=[colour], radii=radius)
        self.recording.log(path, look, static=True)
        base = np.zeros((1, 3))
        lines = [np.vstack([base, each[np.isfinite(each).all(axis=-1)]]) for each in marker]
        self.send(path, rr.LineStrips3D.columns(strips=lines))

    def error(self, name: str, off: Array, row: Rows, colour: Colour) -> None:
        """Mean distance of the markers seen [mm], from their differences [m], (N, 9, 3)."""
        mean = known_mean(1e3 * np.linalg.norm(off, axis=-1), -1)
        seen = np.isfinite(mean)
        self.curve(f"plots/error/{name}", mean[seen], colour, row[seen])

    def curve(
        self, path: str, value: Array, colour: Colour, row: Rows | None = None, name: str = ""
    ) -> None:
        """One line of a plot, in its style."""
        self.style(path, colour, name)
        self.send(path, rr.Scalars.columns(scalars=value), row)

    def style(self, path: str, colour: Colour, name: str = "") -> None:
        """How a line of a plot looks, and its name in the legend: without one, the end of its path."""
        named = name or path.rsplit("/", 1)[-1].replace("_", " ")
        style = rr.SeriesLines(colors=[colour], names=named, widths=[1.3])
        self.recording.log(path, style, static=True)

    def _pose(self, path: str, place: Array, turned: Rotation) -> None:
        pose = rr.Transform3D.columns(translation=place, quaternion=turned.as_quat())
        self.send(path, pose)

    def send(self, path: str, columns: rr.ComponentColumnList, row: Rows | None = None) -> None:
        """Columns of an entity at some rows, or all."""
        row = np.arange(len(self.time)) if row is None else row
        clocks = [
            rr.TimeColumn("time", duration=self.time[row]),
            rr.TimeColumn("step", sequence=self.first + row),
        ]
        rr.send_columns(path, clocks, columns, recording=self.recording)


def _distance(shown: Overlay, measured: Array) -> str:
    far = np.linalg.norm(shown.moved.marker - measured, axis=-1)
    far = far[np.isfinite(far)]
    if not far.size:
        return ""
    name = shown.name.replace("_", " ")
    return f"The {name}'s markers lie {1e3 * far.mean():.1f} mm off on average."
