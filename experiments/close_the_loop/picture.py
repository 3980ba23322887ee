"""Draw the measured arm, the nominal twin and the corrected twin at one held-out moment."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from serpent_twin.arm.geometry import ARM, N_JOINTS, joint_from_motor, link_frames
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array
from serpent_twin.readouts.score import distances, step_means
from serpent_twin.runs.plot_style import COLOURS, INK, LINE
from serpent_twin.runs.report import Figure
from serpent_twin.sessions import Session, read_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin import replay_motors

MEASURED, NOMINAL, CORRECTED = "measured", "nominal twin", "corrected twin"
STYLE = {
    MEASURED: {"color": INK, "lw": 5.0, "alpha": 0.25},
    NOMINAL: {"color": COLOURS[2], "lw": 1.6, "ls": "--"},
    CORRECTED: {"color": COLOURS[1], "lw": 1.6},
}
_DOTS = {MEASURED: ("o", 7), NOMINAL: ("x", 6), CORRECTED: ("+", 8)}
_DROP = 40  # rows at the beginning: a replay settles
_CLEARLY = 0.95  # quantile over moments of how much better the corrected twin is


@dataclass(frozen=True)
class Snapshot:
    """One row of a held-out session, as measured and as two twins have it."""

    arm: str
    session: str
    time_s: float
    joint: Mapping[str, Array]
    """[rad], (9,) each"""
    marker: Mapping[str, Array]
    """[m], (9, 3) each"""
    mean_mm: Mapping[str, float]
    """Mean error of each twin over the whole session"""

    def error_mm(self, twin: str) -> float:
        """Mean marker distance at this moment [mm]."""
        return float(1e3 * np.nanmean(distances(self.marker[twin], self.marker[MEASURED])))


@dataclass(frozen=True)
class Shown:
    """The picture."""

    figure: Figure
    numbers: dict[str, Any]
    """The moment, and how far the twins are off"""


def picture(
    found: Mapping[str, Mapping[str, Any]], folders: Mapping[str, Path], out: Path
) -> Shown | None:
    """The overlay for the arm whose twin gained most; None if none gained anything."""
    gains = {n: e["error_mm"]["nominal"] - e["error_mm"]["corrected"] for n, e in found.items()}
    arm = max(gains, key=lambda name: gains[name])
    if not gains[arm] > 0:
        return None
    session = read_session(folders[arm] / found[arm]["held_out"][0])
    at = moment(arm, session, twin_model.read(out / arm / "twin.json"))
    drawing = draw(at)
    numbers = {"arm": arm, "session": at.session, "time_s": at.time_s}
    off = {name.replace(" ", "_") + "_mm": at.error_mm(name) for name in (NOMINAL, CORRECTED)}
    return Shown(Figure("overlay", drawing, caption(at)), numbers | off)


def moment(arm: str, session: Session, corrected: twin_model.TwinModel) -> Snapshot:
    """A moment at which the nominal twin is clearly off: only one in twenty shows more of a gain."""
    twins = {
        NOMINAL: replay_motors(session.time, session.motor_position),
        CORRECTED: replay_motors(
            session.time, session.motor_position, corrected, session.prior_runtime
        ),
    }
    off = {
        name: step_means(1e3 * distances(twin.marker, session.marker))
        for name, twin in twins.items()
    }
    gain = off[NOMINAL] - off[CORRECTED]
    whole = np.isfinite(session.marker).all(axis=(1, 2)) & (np.arange(len(session)) >= _DROP)
    rows = np.flatnonzero(whole) if whole.any() else np.arange(len(session))
    row = rows[np.argmin(np.abs(gain[rows] - np.quantile(gain[rows], _CLEARLY)))]
    start = joint_from_motor(session.motor_position[row, :N_JOINTS])
    seen = joints_from_markers(session.marker[row], start, corrected.built)
    joint = {MEASURED: seen} | {name: twin.joint_angle[row] for name, twin in twins.items()}
    marker = {MEASURED: session.marker[row]} | {n: t.marker[row] for n, t in twins.items()}
    means = {name: float(np.nanmean(each[_DROP:])) for name, each in off.items()}
    return Snapshot(arm, session.name, float(session.time[row]), joint, marker, means)


def draw(at: Snapshot) -> Drawing:
    """Two side views, gravity downwards: links as lines, markers as dots."""
    drawing = Drawing(figsize=(5.4, 8), layout="constrained")
    for axes, (side, name) in zip(drawing.subplots(1, 2), ((1, "y"), (2, "z")), strict=True):
        for who in (MEASURED, NOMINAL, CORRECTED):
            _arm(axes, at, who, side)
        axes.set(xlabel=f"{name} [mm]", aspect="equal")
        axes.invert_yaxis()  # gravity is +x
        axes.grid(color=LINE, lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[:].set_visible(False)
        axes.tick_params(length=0, labelsize=8)
    axes = drawing.axes[0]
    axes.set_ylabel("x, along gravity [mm]")
    drawing.legend(*axes.get_legend_handles_labels(), loc="outside upper center", frameon=False)
    return drawing


def _arm(axes: Axes, at: Snapshot, who: str, side: int) -> None:
    line = 1e3 * bones(at.joint[who])
    label = who if who == MEASURED else f"{who}, {at.error_mm(who):.1f} mm off"
    axes.plot(line[:, side], line[:, 0], label=label, solid_capstyle="round", **STYLE[who])
    shape, size = _DOTS[who]
    dot = 1e3 * at.marker[who]
    axes.plot(dot[:, side], dot[:, 0], shape, ms=size, color=STYLE[who]["color"], mfc="none")


def bones(q: Array) -> Array:
    """The nine joints and the gripper's end in the base frame [m], (10, 3), at q [rad], (9,)."""
    origin, rotation = link_frames(q)
    end = origin[-1] + rotation[-1, :, 0] * ARM.link_length[-1]
    return np.vstack([origin, end])


def caption(at: Snapshot) -> str:
    """What is to be seen."""
    return (
        f"{at.arm}, {at.session}, held out, {at.time_s:.0f} s after its beginning: two side views. Only "
        f"motor angles drive the twins. Here the nominal twin's markers are {at.error_mm(NOMINAL):.1f} mm "
        f"off, the corrected one's {at.error_mm(CORRECTED):.1f} mm; over the session, "
        f"replayed in one piece, "
        f"{at.mean_mm[NOMINAL]:.1f} and {at.mean_mm[CORRECTED]:.1f} mm. One moment in twenty shows more "
        "of a gain than this."
    )
