"""Test that the best readout is trained by default where possible, and that the report states its basis."""

from dataclasses import replace
from pathlib import Path

import pytest
from learning_sessions import make_session
from trainings import run, write

from serpent_twin.effects.payload import Payload
from serpent_twin.errors import SerpentError
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.runs.provenance import file_hash
from serpent_twin.sessions import read_folder
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN
from serpent_twin.training.known_twin import known_twin
from serpent_twin.training.split import split
from serpent_twin.training.train import Train, planned

HEAVY = NOMINAL_TWIN.with_effect(Payload(mass=0.04))
TWO = ("linear", "observer")


def simulated(folder: Path, **how) -> Path:
    collect(Collect(folder, sessions=3, steps=115, workers=1, **how))
    return folder


@pytest.fixture(scope="module")
def nominal(tmp_path_factory) -> Path:
    return simulated(tmp_path_factory.mktemp("nominal"))


@pytest.fixture(scope="module")
def unknown(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("unknown")
    for number in (1, 2, 3):
        write(folder, make_session(number, rows=120))
    return folder


@pytest.fixture(scope="module")
def twin(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("trace") / "twin.json"
    twin_model.write(path, HEAVY, {})
    return path


def unasked(config: Train) -> list[str]:
    return [name for name, _ in planned(config).wanted]


def test_the_observer_is_trained_unasked_where_the_twin_is_known(nominal, unknown, twin, tmp_path):
    assert "observer" in unasked(Train(nominal, tmp_path))
    assert "filtered_observer" not in unasked(Train(nominal, tmp_path))  # it takes minutes
    assert "observer" not in unasked(Train(unknown, tmp_path))
    assert {"observer", "filtered_observer"} <= set(unasked(Train(unknown, tmp_path, twin=twin)))
    assert unasked(Train(unknown, tmp_path, ("observer",))) == ["observer"]


def test_logs_of_a_softer_arm_and_of_a_twin_with_effects_hold_their_twin(twin, tmp_path):
    soft = replace(NOMINAL_TWIN.parameters, strand_stiffness=8000.0)
    of_soft = planned(Train(simulated(tmp_path / "soft", parameters=soft), tmp_path)).twin
    assert of_soft.exact and of_soft.design and of_soft.design.parameters == soft
    of_heavy = planned(Train(simulated(tmp_path / "heavy", twin=twin), tmp_path)).twin
    assert of_heavy.exact and of_heavy.design
    assert of_heavy.design.fingerprint() == HEAVY.fingerprint()
    of_mjcf = simulated(tmp_path / "mjcf", twin=twin.with_suffix(".xml"))
    assert planned(Train(of_mjcf, tmp_path)).twin.design is None  # which lacks what MJCF cannot say


def test_altered_metadata_are_no_twin(nominal, tmp_path):
    sessions = read_folder(nominal)
    sessions[0].metadata["config"]["parameters"]["strand_slack"] = 1e-3
    assert known_twin(split(sessions)).design is None
    for odd in ("text", [], {"model_sha256": 3}, {"model_sha256": "x", "parameters": "y"}, None):
        for session in sessions:
            session.metadata["config"] = odd
        assert known_twin(split(sessions)).design is None


def test_a_true_model_is_told_and_no_other(nominal, unknown, twin, tmp_path, capsys):
    sentence = "simulated from the same twin that observer simulates"
    run(Train(nominal, tmp_path / "a", TWO))
    assert sentence in capsys.readouterr().out
    for page in ("report.md", "report.html"):
        assert sentence in (tmp_path / "a" / page).read_text()
    run(Train(nominal, tmp_path / "b", ("linear",)))
    run(Train(nominal, tmp_path / "c", TWO, twin=twin))
    assert "true model" not in capsys.readouterr().out
    run(Train(unknown, tmp_path / "d", TWO))
    assert "observer simulates the nominal arm" in capsys.readouterr().out


def test_a_twin_fitted_to_the_test_session_is_told(unknown, tmp_path):
    inputs = {f"session_0{n}": file_hash(unknown / f"session_0{n}.parquet") for n in (1, 2, 3)}
    about = {"provenance": {"input_sha256": inputs, "held_out": 1}}
    twin_model.write(tmp_path / "twin.json", HEAVY, about)
    last = planned(Train(unknown, tmp_path, twin=tmp_path / "twin.json"))
    assert last.twin.note(["observer"]) == ""
    first = planned(Train(unknown, tmp_path, twin=tmp_path / "twin.json", test=("session_01",)))
    assert "was fitted to session_01" in first.twin.note(["linear", "observer"])
    assert first.twin.note(["linear"]) == ""


@pytest.mark.parametrize("origin", [{}, {"input_sha256": {}}, {"held_out": ["session_01.parquet"]}])
def test_a_twin_that_says_nothing_of_its_logs_is_used_all_the_same(origin, unknown, tmp_path):
    twin_model.write(tmp_path / "twin.json", HEAVY, {"provenance": origin})
    assert planned(Train(unknown, tmp_path, twin=tmp_path / "twin.json")).twin.fitted_to == ()


@pytest.mark.parametrize(
    ("origin", "key"),
    [
        ({"input_sha256": []}, "provenance.input_sha256 is an empty list"),
        ({"input_sha256": {"a": 1}}, "provenance.input_sha256.a is 1; it must be a text"),
        ({"held_out": 1.5}, "provenance.held_out is 1.5"),
    ],
)
def test_a_twin_that_says_nonsense_of_its_logs_is_refused(origin, key, unknown, tmp_path):
    twin_model.write(tmp_path / "twin.json", HEAVY, {"provenance": origin})
    with pytest.raises(SerpentError, match=key):
        planned(Train(unknown, tmp_path, twin=tmp_path / "twin.json"))
