"""Test that a replay states its readout's relation to the session, and explains its first screen."""

import json
from dataclasses import replace

import pytest
from rerun.chunk import RrdReader
from trainings import run, write_five

from serpent_twin import readouts, replay
from serpent_twin.arm.mjcf import STRANDS
from serpent_twin.sessions import read_session, write_session
from serpent_twin.training.train import Train

SETS = {1: "training", 3: "training", 4: "validation", 5: "test"}


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Five logs and a readout trained on them: the last tests, the one before it validates."""
    folder = tmp_path_factory.mktemp("trained")
    (folder / "logs").mkdir()
    run(Train(write_five(folder / "logs"), folder / "out", readout=("residual",)))
    return folder


def replayed(session, model, out, capsys):
    replay.main(session, out, model)
    return capsys.readouterr().out, words(out)


def words(recording, entity="/about"):
    """The text of a page of a recording."""
    for chunk in RrdReader(recording).stream().to_chunks():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and "TextDocument:text" in batch.schema.names:
            return batch["TextDocument:text"].to_pylist()[0][0]
    raise AssertionError(f"{entity} has no text")


@pytest.mark.parametrize("number", SETS)
def test_terminal_and_recording_say_in_which_set_the_session_is(number, trained, tmp_path, capsys):
    log, model = trained / "logs" / f"session_{number:02d}.parquet", trained / "out/models/residual"
    said = f"session_{number:02d} is in the {SETS[number]} set of residual"
    for text in replayed(log, model, tmp_path / "a.rrd", capsys):
        assert said in text
    assert (
        said in replayed(log, model, tmp_path / "a.rrd", capsys)[0]
    )  # also when it is there already


def test_a_copy_by_another_name_is_told_by_what_its_motors_read(trained, tmp_path, capsys):
    copy = tmp_path / "session_77.parquet"
    write_session(copy, read_session(trained / "logs/session_01.parquet"))
    text, _ = replayed(copy, trained / "out/models/residual", tmp_path / "a.rrd", capsys)
    assert "session_77 is in the training set of residual" in text
    other = read_session(trained / "logs/session_05.parquet")[:200]
    write_session(tmp_path / "session_78.parquet", replace(other, path=None))
    text, _ = replayed(
        tmp_path / "session_78.parquet", trained / "out/models/residual", tmp_path / "b.rrd", capsys
    )
    assert (
        "neither in the training nor in the validation set of residual, nor in its test set" in text
    )


def test_of_an_older_readout_it_is_unknown(trained, tmp_path, capsys):
    old = tmp_path / "old"
    readouts.load(trained / "out/models/residual").save(old)
    about = json.loads((old / "readout.json").read_text())
    log = trained / "logs/session_05.parquet"
    (old / "readout.json").write_text(
        json.dumps({k: v for k, v in about.items() if k != "tested_on"})
    )
    assert "its test set is unknown" in replayed(log, old, tmp_path / "a.rrd", capsys)[0]
    kept = {k: v for k, v in about.items() if k not in ("tested_on", "trained_on")}
    (old / "readout.json").write_text(json.dumps(kept))
    text, page = replayed(log, old, tmp_path / "b.rrd", capsys)
    said = "It is unknown whether session_05 is in the training, validation or test set of residual"
    assert said in text and said in page


def test_the_first_screen_has_a_key_and_legends(trained, tmp_path):
    """The blueprint lies in the recording, so its views are looked for there."""
    out = tmp_path / "a.rrd"
    replay.main(trained / "logs/session_05.parquet", out, trained / "out/models/residual")
    key = words(out, "/key")
    for colour in ("green", "grey", "orange", "blue … red cable"):
        assert f"| {colour} |" in key
    assert (
        "as the cameras measured it" in key
        and "as `residual` estimates it" in key
        and " N or more" in key
    )
    names = {}
    for chunk in RrdReader(out).stream().to_chunks():
        batch = chunk.to_record_batch()
        if "SeriesLines:names" in batch.schema.names:
            names[chunk.entity_path] = batch["SeriesLines:names"].to_pylist()[0][0]
    assert {names[f"/plots/load/motor{j}"] for j in range(1, 11)} == {
        f"motor {j}" for j in range(1, 11)
    }
    strands = [names[f"/plots/tension/{name}"] for name in STRANDS]
    assert len(set(strands)) == 20 and strands[:2] == ["cable 1+", "cable 1−"]
