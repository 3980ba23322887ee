"""Test that candidates, and numbers far off, compete with calibration where nothing is calibrated yet."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from example import Example
from linear_case import GUST, NOTHING, START, LinearCase, case, every

from serpent_twin.identification import from_opening
from serpent_twin.identification.acceptance import CandidateTrial
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.detection import opening_fit
from serpent_twin.identification.fitting.fitted import fits_better
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.fitting.uncertainty import drawn
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.identification.moved import moved
from serpent_twin.identification.refitting import RefittingTracer
from serpent_twin.identification.score_test import Score, scores
from serpent_twin.identification.widened import leaving
from serpent_twin.machines.candidate import candidate
from serpent_twin.machines.machine import Declared
from serpent_twin.machines.model import open_machine

MJCF = """<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><body>
    <joint name="hinge" axis="0 1 0" damping="0.05" armature="0.005"/>
    <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.01" mass="0.3"/>
    <body name="tool" pos="0.25 0 0"><geom type="sphere" size="0.01" mass="{tool}"/><site name="tip"/></body>
  </body></worldbody>
  <actuator><position name="servo" joint="hinge" kp="25" kv="1" ctrlrange="-2 2"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "motion"
candidates = ["command_delay", "hinge_friction@*"]
time = { column = "t", unit = "s" }
drive = [{ actuator = "servo", column = "goal", unit = "rad" }]
measured = [{ joint = "hinge", columns = ["angle"], unit = "rad" }]
"""
RATE, ROWS, NOISE = 50, 300, 2e-4  # [Hz], of a log, [rad]


@pytest.fixture(scope="module")
def opened():
    made = case(0.7)
    return made, opening_fit(made, every())


def test_a_score_is_of_what_calibration_will_leave(opened):
    """Where all is linear, it is the same before a calibration as after it."""
    made, opening = opened
    calibrated = fit(made, every(), START, free_parameters(made, ()), 3, 99)
    several = [made.candidates[name] for name in (GUST, NOTHING)]
    before, after = (scores(made, every(), base, several) for base in (opening, calibrated))
    for one, other in zip(before, after, strict=True):
        assert one.share == pytest.approx(other.share, abs=2e-3)
    assert before[0].share > 0.5 > before[1].share


def test_numbers_are_tried_whose_priors_hold_them_back(opened):
    made, opening = opened
    held = [Declared(name, "log 1", 0.02, 0.1, 7.0) for name in ("one", "two")]
    tight = replace(made, declared=tuple(held))
    assert leaving(tight, opening_fit(tight, every())) == ["two", "one"]  # −2 and 1 are true
    one_known = replace(tight, widened={"two": 3.5})
    assert leaving(one_known, opening_fit(one_known, every())) == ["one"]
    near = [replace(each, farthest=1.0) for each in held]
    assert leaving(replace(made, declared=tuple(near)), opening) == []  # none can be absent


def test_what_a_fit_leaves_less_is_the_ratio_of_its_residuals(opened):
    made, opening = opened
    calibrated = fit(made, every(), START, free_parameters(made, ()), 3, 99)
    size = [
        float(np.sqrt((each.residual.astype(float) ** 2).mean())) for each in (opening, calibrated)
    ]
    found = fits_better(opening, replace(calibrated, noise=calibrated.noise * 2), made.channels)
    assert found == pytest.approx(np.log(size[0] / (2 * size[1])), abs=1e-6)


def test_what_fits_training_logs_much_better_has_more_evidence():
    """A gain on one held-out log alone does not outweigh it."""
    plain = CandidateTrial(None, None, None, 0.0, fits=0.1)
    assert replace(plain, fits=0.9).evidence > plain.evidence
    assert plain.evidence == pytest.approx(0.05)


@dataclass(frozen=True)
class LimitCase(LinearCase):
    """The gust does nothing up to a strength of 0.6, from where on it grows."""

    def residual(self, points, pieces, timestep=None):
        """The residual with the gust's strength above 0.6 alone."""

        def limited(point):
            size = point.effects.get(GUST, np.zeros(1))
            return replace(point, effects={**point.effects, GUST: np.maximum(size - 0.6, 0.0)})

        return super().residual([limited(each) for each in points], pieces)


def test_a_law_that_does_nothing_at_its_score_is_sought_where_it_does():
    """The score of a force limit is of a strength at which the limit was reached; at the estimated strength
    it may not be.
    """
    made = case(0.05)
    limit = LimitCase(made.X, made.g, made.other, made.y)
    opening = opening_fit(limit, every())
    (score,) = scores(limit, every(), opening, [limit.candidates[GUST]])
    assert score.start[0] < 0.3
    found = full_fit(limit, every(), opening, score, lambda _: None)
    assert found.point.effects[GUST][0] == pytest.approx(0.65, abs=0.01)


def _log(path, model, late, seed):
    """A servo that obeys late, simulated by MuJoCo in steps of 0.2 ms."""
    rng, step = np.random.default_rng(seed), 2e-4
    model.opt.timestep, data = step, mujoco.MjData(model)
    goals = np.repeat(0.7 * rng.uniform(-1, 1, ROWS // 20 + 1), 20)[:ROWS]
    goals = np.convolve(goals, np.ones(8) / 8, "same")
    data.qpos[0], seen, n = goals[0], [], round(1 / RATE / step)
    for k in range(-100 * n, ROWS * n):
        if k >= 0 and k % n == 0:
            seen.append(data.qpos[0] + NOISE * rng.standard_normal())
        data.ctrl[0] = goals[max(0, (k - round(late / step)) // n)]
        mujoco.mj_step(model, data)
    rows = (
        f"{t / RATE:.3f},{u:.7f},{q:.7f}" for t, (u, q) in enumerate(zip(goals, seen, strict=True))
    )
    path.write_text("t,goal,angle\n" + "\n".join(rows) + "\n")


def _traced(folder, tool, late, model=1.2, toml=TOML):
    """The selection of a trace of four short logs, whose tool has 1.2 kg in the model, and the training
    segments.
    """
    Example(MJCF.format(tool=model), toml).write(folder)
    (folder / "logs").mkdir()
    for n in range(4):
        model = mujoco.MjModel.from_xml_string(MJCF.format(tool=tool))
        _log(folder / "logs" / f"run_{n}.csv", model, late, n)
    rig = open_machine(folder / "machine.toml")
    logs = rig.read(folder / "logs")
    made = rig.open(logs[:-1])
    notes = Checkpoints(folder / "stages", made.clock)
    parts = made.pieces(logs[:-1]), made.pieces(logs[-1:])
    return RefittingTracer(made, *parts, notes, lambda _: None, 0).select(), parts[0]


@pytest.mark.slow
def test_a_delay_is_found_that_a_calibration_would_absorb(tmp_path):
    found = _traced(tmp_path, 1.2, 0.03)[0].final
    assert list(found.point.effects) == ["command_delay"]
    assert found.point.effects["command_delay"][0] == pytest.approx(0.03, abs=0.002)


@pytest.mark.slow
def test_a_mass_that_is_not_there_is_no_friction(tmp_path):
    selection, training = _traced(tmp_path, 0.001, 0.0)
    case = selection.case
    assert not selection.final.point.effects
    found = moved(selection.case, selection.settled, ())
    assert [each.name for each in found] == ["mass of tool"]
    assert found[0].value < 0.1
    several = drawn(case, selection.final, training, np.random.default_rng(0), 20)
    k = [each.name for each in selection.case.declared].index("mass of tool")
    assert max(1.2 * np.exp(each.declared[k]) for each in several) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize(("tool", "named"), [(0.5, ["payload@tip"]), (0.22, [])])
def test_a_mass_far_from_what_was_built_is_a_payload(tmp_path, tool, named):
    """The mass of a tool of 0.2 kg absorbs what it carries, on a servo whose gain is known; a tenth more is
    how parts are built.
    """
    toml = TOML.replace('"hinge_', '"payload@tip", "hinge_')
    toml = f'{toml}uncertain = [{{ number = "actuator gain", of = ["servo"], prior = 0.03 }}]\n'
    selection, _ = _traced(tmp_path, tool, 0.0, 0.2, toml)
    assert list(selection.final.point.effects) == named
    k = [each.name for each in selection.case.declared].index("mass of tool")
    assert abs(selection.final.point.declared[k]) < 0.2
    if named:
        assert selection.final.point.effects["payload@tip"][0] == pytest.approx(0.3, abs=0.06)


@pytest.mark.parametrize(("share", "count"), [(0.9, 1), (0.5, 0)])
def test_variants_that_no_fit_changes_into_each_other_are_fitted_each(monkeypatch, share, count):
    """Where they remove nearly as much: friction by the cables' bend beside that of all, at one strand."""
    known = candidate("cable_friction")
    values = known.variants[1].copy()
    values[list(known.ranges).index("strand")] = 4.0
    score = Score("cable_friction", 0.1, 1.0, values, tried=values)
    made = SimpleNamespace(candidates={"cable_friction": known})
    tested: list[np.ndarray] = []

    def told(case, pieces, base, several):
        tested.extend(several[0].variants)
        return [replace(score, share=share * score.share, tried=several[0].variants[0])]

    monkeypatch.setattr(from_opening, "scores", told)
    trials = SimpleNamespace(notes=SimpleNamespace(scores=lambda _, make: make()), training=None)
    found = from_opening._others(trials, made, None, score, "1_start")
    assert len(found) == count
    (other,) = tested
    by = dict(zip(known.ranges, other, strict=True))
    assert by["by_bend"] == 0 and by["strand"] == 4 and by["coefficient"] == known.variants[0][0]


def test_a_candidate_of_one_kind_has_no_others():
    known = candidate("payload")
    score = Score("payload", 0.1, 1.0, known.variants[0], tried=known.variants[0])
    made = SimpleNamespace(candidates={"payload": known})
    assert from_opening._others(SimpleNamespace(), made, None, score, "1_start") == []
