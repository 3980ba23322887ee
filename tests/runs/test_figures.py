"""Test that figures are legible: labels apart, lines apart, logarithmic axes with numbers."""

import itertools
from dataclasses import fields, replace

import numpy as np
import pytest
from figure_checks import wrong
from made_diagnosis import PAYLOAD, comparison, diagnosis
from matplotlib.colors import to_rgb

from experiments.arm_catalogue import CATALOGUE
from serpent_twin.estimators import available
from serpent_twin.identification import figures as of_trace
from serpent_twin.identification.diagnosis import ACCEPTED, NOT_EXCITED, REJECTED, Tried
from serpent_twin.residual import analyse
from serpent_twin.residual.figures import figures as of_residual
from serpent_twin.runs.plot_style import COLD, WARM, round_numbers, styles
from serpent_twin.training import figures as of_readouts

READOUTS = [*available(), "one_more", "and_another"]
RANGES = [(2, 100), (4.1, 4.9), (3, 20), (1e-6, 1e7)]
EFFECTS = sorted(
    {name for kind in CATALOGUE.values() for name in kind.confused_with} | set(CATALOGUE)
    | {"hinge_friction", "stribeck", "torque_saturation",
       "command_delay"}
)  # fmt: skip


def oklab(linear):
    """Björn Ottosson's, of linear RGB; lightness 0 … 100."""
    lms = np.cbrt(linear @ np.array([[0.4122214708, 0.2119034982, 0.0883024619],
                                     [0.5363325363, 0.6806995451, 0.2817188376],
                                     [0.0514459929, 0.1073969566, 0.6299787005]]))  # fmt: skip
    return 100 * lms @ np.array([[0.2104542553, 1.9779984951, 0.0259040371],
                                 [0.7936177850, -2.4285922050, 0.7827717662],
                                 [-0.0040720468, 0.4505937099, -0.8086757660]])  # fmt: skip


SIGHTS = {  # Machado, Oliveira, Fernandes 2009, severity 1
    "normal": np.eye(3),
    "protan": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                        [-0.003882, -0.048116, 1.051998]]),
    "deutan": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                        [-0.011820, 0.042940, 0.968881]]),
}  # fmt: skip


@pytest.mark.parametrize("sight", SIGHTS)
def test_twelve_colours_are_told_apart_also_without_red_or_green(sight):
    rgb = np.array([to_rgb(colour) for colour in (*COLD, *WARM)])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = oklab(np.clip(linear @ SIGHTS[sight].T, 0, 1))
    apart = np.linalg.norm(seen[:, None] - seen, axis=-1)[~np.eye(12, dtype=bool)]
    assert len(rgb) == 12 and apart.min() > 9


@pytest.mark.parametrize("names", [READOUTS[:12], READOUTS[5:], [f"own_{n}" for n in range(40)]])
def test_every_readout_has_a_look_of_its_own(names):
    looks = of_readouts.looks(names)
    drawn = {(look["color"], look["ls"]) for look in looks.values()}
    assert list(looks) == list(names) and len(drawn) == len(names)
    few = names[:12]
    assert len({looks[name]["color"] for name in few}) == len(few)
    assert len({looks[name]["marker"] for name in few}) == len(few)
    first = list(itertools.islice(styles(), 48))
    assert len({tuple(style.items()) for style in first}) == 48


@pytest.mark.parametrize(("low", "high"), RANGES)
def test_figures_of_a_training_are_legible(low, high):
    rng, time = np.random.default_rng(0), np.arange(400) / 4

    def any_of():
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    windows = {name: {h: {"validation_loss": any_of(), "mean_mm": any_of()} for h in range(1, 9)}
               for name in ("linear", "mlp")}  # fmt: skip
    for drawing in (
        of_readouts.by_marker({name: any_of() * np.linspace(1, 1.2, 9) for name in READOUTS}),
        of_readouts.over_time(time, {n: any_of() * (1.1 + np.sin(time)) for n in READOUTS}),
        of_readouts.by_window(windows),
        of_readouts.by_real_windows(
            {n: {c: any_of() for c in (0, 100, 500, 2000, 4236)} for n in READOUTS}
        ),
        of_readouts.by_real_windows({n: {0: any_of(), 195: any_of()} for n in READOUTS}),
    ):
        assert not wrong(drawing)


@pytest.mark.parametrize("centre", [0.3, -3.0, -3e-4, -12345.0])
@pytest.mark.parametrize(
    "verdicts", [(ACCEPTED, REJECTED, NOT_EXCITED), (REJECTED,), (NOT_EXCITED,)]
)
def test_candidates_are_legible_with_all_effects_whatever_they_gain(centre, verdicts):
    rng, tried = np.random.default_rng(1), []
    for k, name in enumerate(EFFECTS):
        verdict = verdicts[k % len(verdicts)]
        fitted = verdict != NOT_EXCITED and k % 4
        gains = rng.normal(centre, abs(centre) / 30, 7) if fitted else None
        tried.append(Tried(name, 3.0, verdict, rng.uniform(0, 0.9), gains, "why"))
    assert len(EFFECTS) >= 17
    for unit in ("mm", "% of stall"):
        assert not wrong(of_trace.ranking(tried, unit).drawing)


@pytest.mark.parametrize(
    "error",
    [(1.0, 6.0, 7.3, 0.5, 9.0), (123.4, 9999.0, 3.0, 0.5, 0.8), (0.01, 0.06, 0.07, 0.005, 0.008),
     (16.8, 1.32, 0.65, 0.24, 0.4)],
)  # fmt: skip
def test_before_and_after_is_legible_also_where_a_twin_is_worse(error):
    of = dict(
        zip(("nominal", "calibrated", "corrected", "noise_floor", "expected"), error, strict=True)
    )
    made = replace(diagnosis(effects=(PAYLOAD,)), error=of, load_error=of)
    drawing = of_trace.before_and_after(made).drawing
    assert not wrong(drawing)
    assert all(axes.get_xlim()[1] >= max(error) for axes in drawing.axes)


@pytest.mark.parametrize(("sessions", "off"), [(1, (8e-2, 1e-3, 2e-4)), (12, (8e-3, 4e-3, 1e-3))])
def test_figures_of_a_residual_are_legible(sessions, off):
    names = dict(zip(("nominal", "calibrated", "corrected"), off, strict=True))
    compared = {name: lasting(comparison(by), sessions) for name, by in names.items()}
    found = {
        n: analyse(compared[n], np.random.default_rng(0), permutations=39)
        for n in names
        if n != "nominal"
    }
    twins = {n: (compared[n], each) for n, each in found.items()}
    drawn = [*of_residual(compared, found["corrected"]), of_trace.by_feature(twins, "of_both"),
             of_trace.place_and_time(twins)]  # fmt: skip
    told = {each.name: wrong(each.drawing) for each in drawn}
    assert {name: each for name, each in told.items() if each} == {} and len(told) == 6


def lasting(one, sessions):
    """A comparison twice as long, of so many sessions."""
    values = {each.name: getattr(one, each.name) for each in fields(one)}
    arrays = {n: np.concatenate([v, v]) for n, v in values.items() if isinstance(v, np.ndarray)}
    count = 2 * len(one)
    called = tuple(f"session_{1 + k * sessions // count:02d}.parquet" for k in range(count))
    return replace(one, session=called, **arrays)


@pytest.mark.parametrize(("low", "high"), [*RANGES, (0.99, 1.01), (7.2, 7.9), (1, 10), (95, 105)])
def test_round_numbers_are_a_few_within_limits(low, high):
    found = round_numbers(low, high)
    assert 2 <= len(found) <= 9 and low <= found[0] < found[-1] <= high
