"""Define one grid point of a sweep, and measure it."""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.command_line.option_groups import Group
from serpent_twin.command_line.options import GIVEN, RateHz, Use, when
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import find
from serpent_twin.numerals import counted
from serpent_twin.reservoir import channels, drive
from serpent_twin.reservoir.basis import fine_cut
from serpent_twin.reservoir.targets import target_products
from serpent_twin.sim.twin_model import TwinModel
from serpent_twin.stored import within

FORMAT = 1
"""Format version of a point's file; raised when what is measured changes otherwise than by settings"""
WINDOW, DROP = 4, 100
"""Rows that a readout sees, and first rows of a session that are not estimated. P"""
_POSE = Group("pose error")


@dataclass(frozen=True)
class GridPoint:
    """One arm, commanded in one way."""

    stiffness: float | None
    """Stiffness of each strand [N/m]; None: rigid cables"""
    slack: float
    """Slack of each strand [m]"""
    damping: float
    """Viscous, of each hinge [N m s/rad]"""
    rate: float
    """Command periods per second [Hz]"""
    amplitude: float
    """Joint targets lie within ± this [rad]"""
    seed: int
    """Seed of inputs and noise: points of one seed have the same inputs"""
    steps: int
    """Command periods measured"""
    load_noise: float = NOMINAL.load_noise
    """Standard deviation of a load reading, as a share of the stall torque"""

    @property
    def parameters(self) -> Parameters:
        """Parameters of the arm; on rigid cables only the noise counts."""
        if self.stiffness is None:
            return replace(NOMINAL, load_noise=self.load_noise)
        return replace(
            NOMINAL,
            strand_stiffness=self.stiffness,
            strand_slack=self.slack,
            joint_damping=self.damping,
            load_noise=self.load_noise,
        )

    @property
    def design(self) -> TwinModel:
        """The arm."""
        return TwinModel(self.parameters)

    @property
    def arm(self) -> dict[str, float]:
        """All numbers of the arm that the point depends on."""
        numbers = {name: float(value) for name, value in asdict(self.parameters).items()}
        return numbers if self.stiffness is not None else {"load_noise": numbers["load_noise"]}

    def described(self) -> dict[str, Any]:
        """Numbers of the point, by names that carry units."""
        return {
            "strand_stiffness_n_per_m": None if self.stiffness is None else float(self.stiffness),
            "strand_slack_m": float(self.slack),
            "hinge_damping_n_m_s_per_rad": float(self.damping),
            "command_rate_hz": float(self.rate),
            "amplitude_rad": float(self.amplitude),
            "load_noise": float(self.load_noise),
            "seed": self.seed,
            "steps": self.steps,
        }

    def check(self) -> None:
        """Raise SerpentError on what cannot be commanded or simulated."""
        drive.check(self.rate, self.amplitude)
        if self.stiffness is not None and not self.stiffness > 0:
            raise SerpentError(f"The stiffness is {self.stiffness:g} N/m; give one above 0.")
        if self.seed < 0 or self.steps < 1:
            raise SerpentError(
                f"The seed is {self.seed} and the steps are {self.steps}: give a seed of at least 0 and "
                "at least one step."
            )
        _ = self.parameters  # which refuse numbers below zero


_OF_BODY, _OF_POSE = when(body=True), when(readouts=GIVEN)


def _without_networks(measuring: "Measuring") -> str:
    if any(find(name).trained.takes("epochs") for name in measuring.readouts):
        return ""
    return "is for networks, and --readouts names none: leave it out, or add one, such as mlp."


@dataclass(frozen=True)
class Measuring:
    """Settings of the measurement, the same for all points of a folder."""

    delays: Annotated[tuple[Annotated[int, within(0, 1000)], ...], _OF_BODY] = (8, 3, 1)
    """Greatest delay of the products of inputs of each total degree from 1, in command periods."""
    memory_delay: Annotated[int, within(0, 1000), _OF_BODY] = 16
    """Greatest delay of the linear memory, in command periods."""
    taps: Annotated[int, within(1, 100), _OF_BODY] = 4
    """Last commands that a readout is given anyway, H; streams for the generalisation rank share as many."""
    stretches: Annotated[int, within(1, 10_000), _OF_BODY] = 40
    """Runs side by side that share the steps."""
    washout: Annotated[int, within(0, 10_000), _OF_BODY] = 24
    """Command periods at the beginning of each stretch that are not measured."""
    repeated: Annotated[int, within(2, 10_000), _OF_BODY] = 500
    """Command periods that a replica repeats from another initial pose."""
    stream: Annotated[int, within(1, 10_000), _OF_BODY] = 12
    """Command periods of each stream for the ranks."""
    coarsest: Annotated[float, within(1e-6, 1e6), _OF_BODY] = 0.1
    """Refuse so few steps that chance reaches capacities above this."""
    sessions: Annotated[int, within(3, 1000), _POSE, _OF_POSE] = 5
    """Sessions of the published protocol, for the pose error; the last one tests."""
    session_steps: Annotated[int, within(DROP + 1, 1_000_000), _POSE, _OF_POSE] = 600
    """Control steps of each session."""
    session_rate: Annotated[RateHz | None, _POSE, _OF_POSE] = None
    """Control steps per second [Hz]; by default as many as a point's command periods."""
    readouts: Annotated[tuple[str, ...], _POSE] = ("analytical", "linear", "residual")
    """Readouts to train and score; others: mlp, lstm, decoder, ensemble, … take longer, up to minutes."""
    epochs: Annotated[int | None, within(1, 1_000_000), _POSE, _OF_POSE, Use(_without_networks)] = (
        None
    )
    """Passes of a network over the training windows; by default its own."""
    body: bool = True
    """Measure memory and capacities; without, the pose errors alone."""

    def rows(self, steps: int) -> int:
        """Command periods of each stretch that are measured."""
        return -(-steps // self.stretches)

    def check(self, steps: int) -> None:
        """Raise SerpentError on settings with which nothing is measured."""
        for name in self.readouts:
            find(name)
        if self.body:
            self._check_body(steps)

    def _check_body(self, steps: int) -> None:
        target_products(N_JOINTS, len(self.delays), self.delays)  # which refuses too many products
        longest = max(*self.delays, self.memory_delay, self.taps)
        if self.washout < longest:
            raise SerpentError(
                f"--washout is {counted(self.washout, 'command period')}, and a delay or the taps "
                f"reach {longest} back: "
                "give at least as many, so that all measures use the same rows."
            )
        if self.stream <= self.taps:
            raise SerpentError(
                f"--stream is {self.stream}; give more than the {counted(self.taps, 'tap')}."
            )
        rows = self.stretches * self.rows(steps)
        fine_cut(rows, channels.COUNT + self.taps * N_JOINTS, self.coarsest)


def key(point: GridPoint, measuring: Measuring) -> str:
    """Name of a point's file: a hash of all that its content depends on."""
    about = {
        "format": FORMAT,
        "point": point.described(),
        "arm": point.arm,
        "measuring": asdict(measuring),
    }
    return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:16]
