"""Draw a live estimate in rerun.

Estimated markers and links, ellipsoids that hold 95 % of the estimated distribution, and measured markers.
This runs in a process of its own.
"""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from scipy.spatial.transform import Rotation

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, joint_from_motor, middles
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.belief import Belief
from serpent_twin.hardware.dynamixel.shutdown import STOPPING
from serpent_twin.live.sample import Page, Sample
from serpent_twin.playback.marker_looks import ESTIMATED, MEASURED
from serpent_twin.playback.rerun_colours import hue
from serpent_twin.playback.rerun_layout import KEY, LOADS, TEN, Plot, blueprint, key, loads
from serpent_twin.playback.rerun_recording import ARROW, Writer
from serpent_twin.readouts.covariance import reach2
from serpent_twin.readouts.score import distances, step_means

EVERY = 0.2
"""Interval at which rows are drawn together [s]"""
MOST = 500
"""Most rows drawn at once"""
PORT = 9876
"""Where rerun's viewer listens"""
_EXPECTED, _LATENCY = (200, 200, 200), (120, 160, 255)
_LOOKS = {
    "orange": "marker, as it is estimated: the mean",
    "orange ellipsoid": "should hold the measured marker in 95 % of the rows",
    "green": "marker, as the cameras measured it",
}

_FELT = {"orange arrow": "force that is felt, 10 cm a newton; its ellipsoid should hold 95 %"}


def draw(rows: Connection, page: Page) -> None:
    """Draw samples as they come until there are no more: the main function of the process.

    It sends an error text, or an empty one, when it is ready and when it ends.
    """
    for number in STOPPING:  # the loop ends first, then this
        signal.signal(number, signal.SIG_IGN)
    os.nice(5)
    try:
        drawing = Drawing(page)
        rows.send("")
    except SerpentError as error:
        rows.send(str(error))
        return
    for batch in _batches(rows):
        drawing.add(batch)
    said = drawing.end()
    try:
        rows.send(said)
    except OSError:  # the receiver is gone
        return


def _batches(rows: Connection) -> Iterator[list[Sample]]:
    """The samples of each moment, at least one, until there are no more."""
    batch: list[Sample] = []
    until, ended = np.inf, False
    while not ended:
        try:
            if rows.poll(EVERY):
                sample = rows.recv()
                ended = sample is None
                batch += [] if ended else [sample]
        except (EOFError, OSError):
            ended = True
        until = min(until, time.monotonic() + EVERY) if batch else np.inf
        if batch and (ended or len(batch) >= MOST or time.monotonic() >= until):
            yield batch
            batch, until = [], np.inf


class Drawing:
    """A recording that grows."""

    def __init__(self, page: Page) -> None:
        self._page, self._rows = page, 0
        self._part = page.file and page.file.with_name(page.file.name + ".part")
        self._stream = rr.RecordingStream("serpent_twin")
        sinks: list[Any] = [rr.FileSink(self._part)] if self._part else []
        if page.view:
            open_viewer()
            sinks.append(rr.GrpcSink())
        title = f"{page.readout}, live"
        self._stream.set_sinks(*sinks, default_blueprint=blueprint(title, _plots(page.feels)))
        self._stream.send_recording_name(title)
        self._begin()

    def add(self, batch: Sequence[Sample]) -> None:
        """Draw some rows."""
        arrays = map(np.array, zip(*batch, strict=True))
        columns: dict[str, Any] = dict(zip(Sample._fields, arrays, strict=True))
        moment, motor, load = (columns[name] for name in ("time", "motor", "load"))
        measured, estimated = columns["measured"], columns["estimated"]
        covariance, latency = columns["covariance"], columns["latency_ms"]
        writer = Writer(self._stream, moment, first=self._rows)
        self._rows += len(batch)
        joint = joints_from_markers(estimated, joint_from_motor(motor[:, :N_JOINTS]))
        writer.motion(motor, joint, np.zeros(len(joint)))
        self._points(writer, "measured", measured)
        self._points(writer, "estimated", estimated)
        self._ellipsoids(writer, estimated, covariance)
        spread = Belief(estimated, covariance).spread
        self._curve(
            writer, "plots/error/measured", step_means(1e3 * distances(estimated, measured))
        )
        self._curve(writer, "plots/error/expected_rms", step_means(1e3 * spread))
        self._curve(writer, "plots/latency/ms", latency)
        for j in range(N_MOTORS):
            self._curve(writer, f"{LOADS}/motor{j + 1}", 100 * load[:, j])
        if self._page.feels:
            self._force(writer, joint, columns)

    def end(self) -> str:
        """Finish the recording; returns an error text, or an empty one."""
        said = ""
        try:
            self._stream.flush()
        except RuntimeError as error:
            said = f"rerun could not be given everything ({error})."
        try:
            self._stream.disconnect()
        except RuntimeError as error:
            said = said or f"rerun could not be given everything ({error})."
        if self._part and self._page.file and self._part.exists():
            if self._rows:
                self._part.rename(self._page.file)
            else:
                self._part.unlink()
        return said

    def _begin(self) -> None:
        """Draw what does not change."""
        writer, fixed = Writer(self._stream, np.zeros(0)), {"static": True}
        looks = {"measured": (MEASURED, 0.0050), "estimated": (ESTIMATED, 0.0048)}
        for kind, (colour, radius) in looks.items():
            points = rr.Points3D.from_fields(colors=[colour], radii=[radius])
            self._stream.log(f"markers/{kind}", points, **fixed)
        fill = rr.components.FillMode.TransparentFillMajorWireframe
        look = rr.Ellipsoids3D.from_fields(colors=[(*ESTIMATED, 60)], fill_mode=fill)
        self._stream.log("markers/expected", look, **fixed)
        if self._page.feels:
            arrow = rr.Arrows3D.from_fields(colors=[ESTIMATED], radii=0.003)
            self._stream.log("arm/force", arrow, **fixed)
            self._stream.log("arm/force_expected", look, **fixed)
            writer.style("plots/force/estimated", ESTIMATED)
            writer.style("plots/force/expected_rms", _EXPECTED)
        colours = {
            "error/measured": ESTIMATED,
            "error/expected_rms": _EXPECTED,
            "latency/ms": _LATENCY,
        }
        for name, colour in colours.items():
            writer.style(f"plots/{name}", colour)
        for j in range(N_MOTORS):
            writer.style(f"{LOADS}/motor{j + 1}", hue(j), f"motor {j + 1}")
        lines = [
            f"### {self._page.readout}, live",
            f"{self._page.about}.",
            "Pose: as estimated, from the motor bus alone.",
        ]
        page = rr.TextDocument("\n\n".join(lines), media_type="text/markdown")
        self._stream.log("about", page, **fixed)
        self._stream.log(KEY, key(_LOOKS | (_FELT if self._page.feels else {})), **fixed)
        self._stream.log("/", rr.ViewCoordinates.DLF, **fixed)  # +x hangs down
        writer.shapes()

    def _force(self, writer: Writer, joint: Array, columns: dict[str, Any]) -> None:
        """An arrow for the force where contact is reported, an ellipsoid at its tip that should hold the true
        one, and its size.
        """
        force, covariance = columns["force"], columns["force_covariance"]
        self._curve(writer, "plots/force/estimated", np.linalg.norm(force, axis=1))
        self._curve(
            writer, "plots/force/expected_rms", np.sqrt(np.trace(covariance, axis1=1, axis2=2))
        )
        there = columns["touched"]
        row, which = np.flatnonzero(there), columns["link"][there] - 1
        place = middles(joint[row])[np.arange(len(row)), which]
        arrow, parts = ARROW * force[row], there.astype(int)
        shown = rr.Arrows3D.columns(origins=place, vectors=arrow)
        writer.send("arm/force", shown.partition(parts))
        half, turned = ellipsoids(ARROW**2 * covariance[row])
        held = rr.Ellipsoids3D.columns(
            centers=place + arrow, half_sizes=half, quaternions=turned.as_quat().reshape(-1, 4)
        )
        writer.send("arm/force_expected", held.partition(parts))

    @staticmethod
    def _points(writer: Writer, kind: str, marker: Array) -> None:
        seen = np.isfinite(marker).all(axis=-1)
        points = rr.Points3D.columns(positions=marker[seen])
        writer.send(f"markers/{kind}", points.partition(seen.sum(axis=1)))

    @staticmethod
    def _ellipsoids(writer: Writer, centre: Array, covariance: Array) -> None:
        known = np.isfinite(centre).all(axis=-1) & np.isfinite(covariance).all(axis=(-2, -1))
        half, turned = ellipsoids(covariance[known])
        shapes = rr.Ellipsoids3D.columns(
            centers=centre[known], half_sizes=half, quaternions=turned.as_quat().reshape(-1, 4)
        )
        writer.send("markers/expected", shapes.partition(known.sum(axis=1)))

    @staticmethod
    def _curve(writer: Writer, path: str, value: Array) -> None:
        row = np.flatnonzero(np.isfinite(value))
        writer.send(path, rr.Scalars.columns(scalars=value[row]), row)


def ellipsoids(covariance: Array) -> tuple[Array, Rotation]:
    """Half axes [m], (N, 3), and rotations of ellipsoids that hold 95 % of normal errors of these covariances
    [m²], (N, 3, 3).
    """
    variance, axes = np.linalg.eigh(covariance)
    axes[..., -1] *= np.linalg.det(axes)[:, None]  # right-handed
    return np.sqrt(reach2() * np.maximum(variance, 0)), Rotation.from_matrix(axes)


def open_viewer(patience: float = 20.0) -> None:
    """Start rerun's viewer, if none listens yet."""
    if _listens():
        return
    command = [sys.executable, "-m", "rerun", "--port", str(PORT), "--hide-welcome-screen"]
    quiet = subprocess.DEVNULL
    viewer = subprocess.Popen(command, stdout=quiet, stderr=quiet, start_new_session=True)
    until = time.monotonic() + patience
    while time.monotonic() < until and viewer.poll() is None and not _listens():
        time.sleep(0.1)
    time.sleep(1.0)  # it listens before it looks for a display
    if viewer.poll() is not None or not _listens():
        viewer.kill()
        raise SerpentError(
            "the viewer could not be opened here. Leave out --view, take OUT/session_01.rrd to a machine "
            "with a display, and run `rerun FILE` there."
        )


def _listens() -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", PORT)) == 0


def _plots(feels: bool) -> dict[Plot, int]:
    error = rrb.TimeSeriesView(
        origin="plots/error", name="Marker error: measured, and as expected [mm]"
    )
    latency = rrb.TimeSeriesView(origin="plots/latency", name="From reading to estimate [ms]")
    force = rrb.TimeSeriesView(origin="plots/force", name="Force: felt, and its expected error [N]")
    plots: dict[Plot, int] = {error: 1, loads(): TEN, latency: 1}
    return plots | ({force: 1} if feels else {})
