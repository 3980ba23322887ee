"""Test that noise that too few rows determine is reported as unknown, not as zero."""

import json
from dataclasses import replace

import numpy as np
import pytest
from diagnoses import ERRORS
from made_diagnosis import diagnosis
from residual_cases import LOAD_NOISE, NOISE, made

from serpent_twin.identification import page, tables
from serpent_twin.identification.summary import summary
from serpent_twin.residual import analyse, describe
from serpent_twin.residual.figures import figures
from serpent_twin.residual.noise import in_words, measurement_noise
from serpent_twin.runs.files import finite


@pytest.mark.parametrize("rows", [8, 12, 20, 40])
def test_of_few_rows_the_noise_is_unknown(rows):
    noise = measurement_noise(made(3, S=1, T=rows))
    for value in (noise.mean_floor, noise.mean_jitter, noise.load_floor):
        assert np.isnan(value)
    assert np.isnan(noise.load).all() and np.isnan(noise.marker).all()


@pytest.mark.parametrize("rows", [320, 640])
def test_a_noise_that_is_told_is_near_the_true_one(rows):
    for seed in range(4):
        noise = measurement_noise(made(seed, S=rows // 160, T=160))
        assert 0.5 < np.median(noise.marker) / NOISE < 1.3
        assert 0.5 < np.median(noise.load) / LOAD_NOISE < 1.3


def test_a_motor_that_hardly_turns_does_not_lower_the_noise_of_the_others():
    whole = made(3)
    seen = np.ones(whole.load_residual.shape, bool)
    seen[..., 4] = False
    seen[0, :20, 4] = True
    noise, all_seen = measurement_noise(replace(whole, load_counts=seen)), measurement_noise(whole)
    assert np.isnan(noise.load[4]) and np.isfinite(np.delete(noise.load, 4)).all()
    assert noise.load_floor == pytest.approx(all_seen.load_floor, rel=0.05)
    assert noise.rms_load_jitter == pytest.approx(all_seen.rms_load_jitter, rel=0.05)


def test_what_is_said_of_a_short_log():
    short = made(3, S=1, T=40)
    found = analyse(short, np.random.default_rng(0), permutations=19)
    said = describe(found)
    assert "noise alone: unknown: too few rows" in said and "nan" not in said
    assert "0.00" not in said and "no more than noise" not in said
    assert np.isnan(found.above_noise)
    json.dumps(finite(found.numbers()), allow_nan=False)
    for figure in figures({"calibrated": short}, found):
        figure.drawing.canvas.draw()


def test_the_traces_page_table_and_sentence():
    unknown = ERRORS | {"noise_floor": float("nan")}
    told = diagnosis(error=unknown, load_error=unknown)
    assert "what noise alone makes is unknown: too few rows" in page.lead(told)
    said = summary(told, {})
    assert "unknown: too few rows)" in said and "nan" not in said
    table = tables.errors(told)
    assert table.header == ("twin", "markers [mm]", "loads [% of stall]")
    assert table.rows[-1] == ("noise alone", "–", "–")
    assert "–: unknown: too few rows." in table.note and all(table.numeric[1:])
    assert tables.errors(diagnosis(error=ERRORS)).note.count("unknown") == 0


def test_a_noise_in_words():
    assert in_words(0.456, "mm") == "0.46 mm"
    assert in_words(None, "mm") == in_words(float("nan"), "%") == "unknown: too few rows"
