"""Test that the experiments' figures are legible, and that their titles name what was given."""

from dataclasses import replace

import numpy as np
import pytest
from figure_checks import wrong
from made_diagnosis import diagnosis

from experiments.arm_catalogue import candidates
from experiments.close_the_loop import picture
from experiments.sim_to_real import figures as routes
from serpent_twin.arm.geometry import N_JOINTS, markers
from serpent_twin.identification.page import page

RNG = np.random.default_rng(0)


def arm(most, low=0.3, high=20.0):
    def curve():
        counts = ["0", *(str(c) for c in (100, 500, 2000) if c < most), "all"]
        return {count: float(RNG.uniform(low, high)) for count in counts}

    routes_of = {
        name: {route: curve() for route in routes._LABEL} for name in ("residual_mlp", "residual")
    }
    shares = {f"{share:.2f}": float(share) for share in np.linspace(0.5, 0.99, 6)}
    return {"windows": {"train": most}, "curves_mm": routes_of, "observer_mm": 0.6,
            "hybrid_mm": {k: v for k, v in curve().items() if k != "0"}, "lstm_mm": 2.3,
            "coverage": shares}  # fmt: skip


@pytest.mark.parametrize("most", [120, 2100, 14_000])
@pytest.mark.parametrize("count", [1, 4, 12])
def test_routes_are_legible_for_few_and_many_arms_and_windows(most, count):
    arms = {f"arm_{n}": arm(most) for n in range(count)}
    for drawing in (routes.curves(arms), routes.coverage(arms)):
        assert not wrong(drawing)
    errors = {"error_mm": list(RNG.uniform(0.4, 0.6, 400))}
    changes = {k: {"what": k, "at_row": 200, "estimators": {f"estimator {n}": errors for n in range(count)}}
               for k in ("payload", "tilt")}  # fmt: skip
    assert not wrong(routes.changes(changes))


def test_every_arm_has_a_look_of_its_own():
    axes = routes.coverage({f"arm_{n}": arm(500) for n in range(14)}).axes[0]
    looks = [(line.get_color(), line.get_linestyle()) for line in axes.get_lines()[1:]]
    assert len(set(looks)) == len(looks) == 14


def test_the_two_views_of_the_loop_are_legible():
    joint = {who: RNG.uniform(-0.3, 0.3, N_JOINTS) for who in picture.STYLE}
    at = picture.Snapshot("arm_x", "session_04", 12.0, joint, {w: markers(q) for w, q in joint.items()},
                        {picture.NOMINAL: 9.0, picture.CORRECTED: 1.0})  # fmt: skip
    assert not wrong(picture.draw(at))


def test_titles_name_what_was_given():
    title = page(diagnosis(), {"logs": "data/arm_a"}, candidates()).title
    assert title == "What the twin of arm_x lacks (data/arm_a, judged by session_04)"
    assert page(replace(diagnosis(), held_out=()), {}, candidates()).title.endswith("arm_x lacks")
