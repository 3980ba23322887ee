"""Test that a live estimate simulates the arm that its readout was trained on, or says otherwise."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_runs import logged
from typed import typed

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects.payload import Payload
from serpent_twin.estimators import find, load
from serpent_twin.estimators.adapted import Adapted
from serpent_twin.live.estimate import estimate
from serpent_twin.live.options import Estimate
from serpent_twin.readouts.windows import cut
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import read_folder, read_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN
from serpent_twin.tables.repeated import readings_hash

SOFT = replace(NOMINAL_TWIN, parameters=replace(NOMINAL, strand_stiffness=8e3)).with_effect(
    Payload(mass=0.02)
)
FEW = {"steps": 12, "record": False}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Logs of a soft arm, its twin.json, and readouts trained on them: two of windows, two with a twin."""
    folder = tmp_path_factory.mktemp("soft")
    twin_model.write(folder / "soft.json", SOFT, {})
    twin_model.write(folder / "nominal.json", NOMINAL_TWIN, {})
    collect(
        Collect(folder / "logs", sessions=2, steps=70, workers=1, arm="soft", seed=3,
                twin=folder / "soft.json")
    )  # fmt: skip
    train, validate = (cut([s], 4, drop=10) for s in read_folder(folder / "logs"))
    rng = np.random.default_rng(0)
    made = {"residual": find("residual")(4)}
    made["observer"] = find("observer")(4, twin=twin_model.to_dict(SOFT))
    made["foreign"] = find("observer")(4)
    for each in made.values():
        each.trained.fit(train, validate, rng)
    made["adapted"] = Adapted.of(made["observer"])
    made["adapted"].trained.fit(train, train, rng)
    for name, each in made.items():
        each.trained.save(folder / name)
    return folder


def told(folder: Path, capsys, name: str, out: Path, **options) -> tuple[str, dict]:
    capsys.readouterr()
    found = estimate(Estimate(folder / name, out, **FEW, **options))
    line = capsys.readouterr().out.splitlines()[0]
    assert found["simulated_arm"] == line
    return line, found


@pytest.mark.parametrize("name", ["observer", "adapted"])
def test_an_observers_own_twin_is_simulated_unless_another_is_named(name, folder, tmp_path, capsys):
    line, found = told(folder, capsys, name, tmp_path / "own")
    assert line == (
        f"The simulated arm is {name}'s own twin (trained on 2 sessions of soft); --simulate names another."
    )
    assert found["trained_on_simulated_arm"] is True
    (path,) = collect(
        Collect(tmp_path / "logs", sessions=1, steps=12, workers=1, twin=folder / "soft.json")
    )
    np.testing.assert_array_equal(logged(tmp_path / "own").marker, read_session(path).marker)
    assert twin_model.simulated_by(logged(tmp_path / "own").metadata) == SOFT


def test_another_arm_than_the_observers_is_said(folder, tmp_path, capsys):
    nominal = folder / "nominal.json"
    line, found = told(folder, capsys, "observer", tmp_path / "a", simulate=nominal)
    assert "nominal.json, not observer's own twin (trained on 2 sessions of soft)" in line
    assert found["trained_on_simulated_arm"] is False
    given = replace(NOMINAL, strand_stiffness=9e3)
    line, _ = told(folder, capsys, "observer", tmp_path / "b", parameters=given)
    assert "that of the given parameters, not observer's own twin" in line
    line, _ = told(folder, capsys, "observer", tmp_path / "c", simulate=folder / "soft.json")
    assert line.endswith("soft.json, observer's own twin.")
    line, _ = told(folder, capsys, "foreign", tmp_path / "d", simulate=folder / "soft.json")
    assert "not foreign's" not in line and "not observer's own twin" in line


def test_a_twin_that_replaces_the_observers_own_is_not_what_is_simulated(folder, tmp_path, capsys):
    line, _ = told(folder, capsys, "observer", tmp_path / "a", twin=folder / "nominal.json")
    assert line.endswith(f"another. It estimates by {folder / 'nominal.json'}.")
    told(folder, capsys, "observer", tmp_path / "b")
    own, other = logged(tmp_path / "b"), logged(tmp_path / "a")
    np.testing.assert_array_equal(own.marker, other.marker)


def test_a_readout_of_windows_says_whether_the_arm_is_that_of_its_logs(folder, tmp_path, capsys):
    line, found = told(folder, capsys, "residual", tmp_path / "a")
    assert line == (
        "The simulated arm is the nominal one, not the arm that residual was trained on (trained on "
        "2 sessions of soft): the errors are those of a readout on another arm."
    )
    assert found["trained_on_simulated_arm"] is False
    line, found = told(folder, capsys, "residual", tmp_path / "b", simulate=folder / "soft.json")
    assert line.endswith("soft.json, the arm that residual was trained on.")
    assert found["trained_on_simulated_arm"] is True


def test_a_readout_knows_the_logs_that_it_was_trained_on(folder):
    sessions = read_folder(folder / "logs")
    expected = [
        (s.name, "soft", readings_hash(s), SOFT.fingerprint(), use)
        for s, use in zip(sessions, ("train", "validate"), strict=True)
    ]
    for name in ("residual", "observer", "adapted"):
        known = load(folder / name).trained.trained_on
        found = [
            (k.session, k.arm, k.readings_sha256, k.model_sha256, k.use)
            for k in known
        ]  # fmt: skip
        assert found == expected


def test_of_a_readout_that_does_not_know_its_logs_that_is_said(folder, tmp_path, capsys):
    old = tmp_path / "old"
    old.mkdir()
    (old / "learned.npz").write_bytes((folder / "residual" / "learned.npz").read_bytes())
    about = json.loads((folder / "residual" / "readout.json").read_text())
    del about["trained_on"], about["stopped_after_epochs"]
    (old / "readout.json").write_text(json.dumps(about))
    line, found = told(tmp_path, capsys, "old", tmp_path / "out")
    assert line.endswith("It is not known on which arm's logs residual was trained.")
    assert found["trained_on_simulated_arm"] is None


def test_the_command_prints_it(folder, tmp_path):
    words = ["--model", folder / "observer", "--out", tmp_path / "out", "--steps", 8, "--no-record"]
    done = typed("serpent_twin.estimate", *words)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("The simulated arm is observer's own twin")
