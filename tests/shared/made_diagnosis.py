"""A diagnosis of an arm, made up of comparisons with a known error."""

from dataclasses import replace
from functools import cache

import numpy as np

from serpent_twin.identification.bars import Bars
from serpent_twin.identification.diagnosis import Diagnosis, Named, Tried
from serpent_twin.identification.estimates import Calibrated, ParameterEstimate
from serpent_twin.identification.excitation import InputExcitation
from serpent_twin.identification.fitting.weak_directions import WeakDirection
from serpent_twin.identification.identifiability import (
    EffectIdentifiability,
    Identifiability,
    ParameterIdentifiability,
)
from serpent_twin.identification.unexplained import Unexplained
from serpent_twin.residual import Comparison, analyse, marker_size
from serpent_twin.residual.learned import Learned
from serpent_twin.residual.whiteness import whiteness

S, T, MARKERS, MOTORS = 6, 80, 4, 3
NAN = float("nan")
PAYLOAD = Named(
    "payload",
    {
        "mass": ParameterEstimate(0.0342, 0.0311, 0.0373, "kg"),
        "place": ParameterEstimate(0.09, 0.09, 0.09, "m"),
    },
    gain=2.5,
    gain_load=1.2,
    probability_of_chance=0.0001,
    judged_on="held-out logs",
)
TRIED = (
    Tried("gear_backlash", 4.0, "not excited", 0.001, None, "the motors never turned back"),
    Tried("link_flex", 3.9, "rejected", 0.2, np.linspace(-0.2, 0.4, S), "no gain beyond chance"),
    Tried("payload", 1.5, "accepted", 0.7, np.linspace(2.3, 2.7, S), "gains 2.50 mm"),
    Tried("cable_creep", 4.0, "rejected", 0.004, None, "not worth a fit"),
)
CALIBRATION = {
    "stiffness of cable1_plus": Calibrated(
        ParameterEstimate(0.1, 0.08, 0.12, "log N/m"), "strand stiffness 1+", 18.8, 20.0,
        ParameterEstimate(22.1034, 21.6657, 22.5499, "kN/m"),
    ),
    "slack of cable1_plus": Calibrated(
        ParameterEstimate(-0.3, -0.5, -0.1, "mm"), "strand slack 1+", 0.389, 0.2,
        ParameterEstimate(-0.1, -0.3, 0.1, "mm"),
    ),
    "slack of cable1_minus": Calibrated(
        ParameterEstimate(0.01, -0.4, 0.42, "mm"), "strand slack 1−", NAN, 0.2,
        ParameterEstimate(0.21, -0.2, 0.62, "mm"),
    ),
}  # fmt: skip
IDENTIFIABILITY = Identifiability(
    (ParameterIdentifiability("strand slack 1+", "mm", 0.3, 0.1, 1.8, "payload", -0.4),),
    (
        EffectIdentifiability("mocap_latency", "delay", "s", 0.03, 0.001, 0.004, 0.2, {}),
        EffectIdentifiability(
            "cable_creep", "share", "1", 0.3, 0.1, 0.5, 0.9, {"clamp_slip": 0.85}
        ),
        EffectIdentifiability(
            "clamp_slip", "rate", "m/(N s)", 1e-5, np.inf, np.inf, 0.0, {}, "unstable"
        ),
    ),
    (WeakDirection("strand slack 1+", "strand slack 1+", "mm", 0.3, 0.1),),
    (InputExcitation("motor 1", 1.0, 0.2),),
    "To show cable creep, hold poses for longer.",
    480,
    9.0,
)


@cache
def comparison(off, markers=True, loads=True, seed=1):
    """Markers off by about `off` [m], in proportion to motor 1's angle, and loads likewise."""
    rng = np.random.default_rng(seed)
    angle = 0.5 * np.sin(0.3 * np.arange(S * T) + np.pi * rng.random((MOTORS, 1)))
    angle = angle.T.reshape(S, T, MOTORS)
    pose = np.zeros((S, T, MARKERS, 3)) + np.arange(MARKERS)[:, None] * 0.07
    error = rng.normal(0, 4e-4, pose.shape)
    error[..., 1] += off * angle[..., :1] * np.arange(1, MARKERS + 1)
    felt = rng.normal(0, 0.006, angle.shape)
    felt[..., 0] += 20 * off * angle[..., 0]
    return Comparison(
        session=("session_04.parquet",) * S,
        time=0.25 * np.arange(S * T).reshape(S, T),
        marker_measured=pose + error if markers else None,
        marker_predicted=pose if markers else None,
        load_measured=felt if loads else None,
        load_predicted=np.zeros_like(felt) if loads else None,
        motor_angle=angle,
        motor_velocity=np.diff(angle, axis=1, append=angle[:, -1:]) / 0.25,
    )


@cache
def findings(off, markers=True, loads=True):
    return analyse(comparison(off, markers, loads), np.random.default_rng(0), permutations=39)


def diagnosis(markers=True, loads=True, **found):
    off = {"nominal": 8e-3, "calibrated": 4e-3, "corrected": 1e-3 if found.get("effects") else 4e-3}
    compared = {name: comparison(by, markers, loads) for name, by in off.items()}
    sizes = {name: marker_size(c).mean for name, c in compared.items()} if markers else {}
    nothing = dict.fromkeys((*off, "noise_floor", "expected"), NAN)
    percent = {"nominal": 6.0, "calibrated": 3.0, "corrected": 0.9, "noise_floor": 0.6}
    made = Diagnosis(
        bars=Bars(0.24, 0.38, 0.3),
        arm="arm_x",
        held_out=("session_04.parquet",),
        effects=(),
        candidates=TRIED,
        unexplained=Unexplained(False, 0.0, ""),
        error={**sizes, "noise_floor": 0.64, "expected": sizes["corrected"]}
        if markers
        else nothing,
        load_error=percent if loads else dict.fromkeys(percent, NAN),
        cautions=("Slack of cable1_plus and stiffness of cable 1 cannot be told apart.",),
        calibration=CALIBRATION,
        comparisons=compared,
        findings={n: findings(off[n], markers, loads) for n in ("calibrated", "corrected")},
        learned=Learned((0,), 0.25, {"offset": np.zeros(12)}),
        identifiability=IDENTIFIABILITY,
        whiteness=whiteness(compared["corrected"]),
    )
    return replace(made, **found)
