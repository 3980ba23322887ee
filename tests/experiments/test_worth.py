"""Test what a fault's true law is worth against an ordinary least-squares fit of it."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from made_residual import Made, S

from experiments.confusion import worth as module
from experiments.confusion.worth import worth
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification import Trace
from serpent_twin.identification.discovery.followed import Way, swinging

STEP = "joint_torque of joint1: above joint_angle of joint1"
WAVE = "joint_torque of joint1: periodic motor_angle of motor2"
PUSH = "force of link3: constant"


@pytest.fixture
def traced(monkeypatch, tmp_path):
    """A trace of a machine with a made residual, which began to seek laws from its fit."""

    def of(made):
        case = SimpleNamespace(
            **vars(made.case),
            pieces=lambda _: made.pieces,
            take=lambda pieces, _: pieces,
            places=lambda *_: made,
            clock=None,
        )
        fit = SimpleNamespace(**vars(made.fit), used=())
        rig = SimpleNamespace(open=lambda _: case)
        tracer = SimpleNamespace(named=lambda: (None, fit, []), case=case, training=made.pieces)
        monkeypatch.setattr(module, "planned", lambda _: (rig, [], []))
        monkeypatch.setattr(module, "ComposingTracer", lambda *_: tracer)
        monkeypatch.setattr(module, "Checkpoints", lambda *_: None)
        return Trace((Path("logs"),), tmp_path)

    return of


@pytest.mark.parametrize(
    ("name", "effect", "ways"),
    [
        (STEP, Discovered(0.3, at=STEP, first=0.2), [Way("above", "joint_angle", "joint1", 0.2, 0.0)]),
        (WAVE, Discovered(0.3, at=WAVE, first=3.0, second=1.0), swinging(("motor_angle", "motor2"), 3.0)),
        (PUSH, Discovered(0.1, -0.1, 0.2, at=PUSH), [Way("constant", "", "", 0.0, 0.0)]),
    ],
    ids=["a step", "a sine and its cosine", "a constant push"],
)  # fmt: skip
def test_a_law_is_worth_what_a_fit_of_it_removes(traced, name, effect, ways):
    """The slopes' priors are so wide that they hardly count."""
    made = Made(effect)
    law = parse(name)
    shown = next(each.change for each in made.responses if each.handle == law.handle)
    slopes = made.fit.jacobian.reshape(len(made.fit.jacobian), -1).T.astype(float)
    y = made.fit.residual.ravel()
    columns = []
    for way in ways:
        x = made.readings.get((way.reading, way.where), np.zeros(shown.shape[1:3]))
        shape = SHAPES[way.shape]
        follows = shape.form(x, way.first, way.second) if way.reading else np.ones_like(x)
        columns += [(follows[..., None] * each).reshape(S, -1).ravel() for each in shown]

    def left(A):
        return float(((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2).sum())

    before, after = left(slopes), left(np.c_[slopes, np.array(columns).T])
    total = float((y**2).sum())
    expected = -total * np.log1p(-(before - after) / total)
    assert worth(traced(made), (law, ways)) == pytest.approx(expected, rel=0.01)
