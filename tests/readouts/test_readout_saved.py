"""Test that a saved readout is loaded only if every setting and array is there, in the right shape."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from made_readouts import made

from serpent_twin.errors import SerpentError
from serpent_twin.estimators import available
from serpent_twin.estimators import load as load_estimator
from serpent_twin.readouts.trainable import Trainable


def load(folder: Path) -> Trainable:
    return load_estimator(folder).trained


MADE = [*available(), "adapted"]


@pytest.fixture
def saved(tmp_path):
    made("linear").save(tmp_path / "linear")
    return tmp_path / "linear"


def edit(folder: Path, **changes: object) -> None:
    path = folder / "readout.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def learned(folder: Path) -> dict[str, np.ndarray]:
    with np.load(folder / "learned.npz") as arrays:
        return dict(arrays)


@pytest.mark.parametrize("name", MADE)
def test_what_a_readout_says_that_it_learns_comes_back(name, tmp_path):
    readout = made(name)
    readout.save(tmp_path)
    again = load(tmp_path)
    assert json.dumps(again.config()) == json.dumps(readout.config())
    assert repr((again.history, again.rate_hz)) == repr((readout.history, readout.rate_hz))
    assert {file.name for file in tmp_path.iterdir()} == {"readout.json", "learned.npz"}
    np.testing.assert_array_equal(again.covariance, readout.covariance)
    assert again.learned.keys() == readout.learned.keys()
    for key, values in again.learned.items():
        assert np.array_equal(values, readout.learned[key])


@pytest.mark.parametrize("name", [name for name in MADE if name != "analytical"])
def test_every_array_is_looked_at(name, tmp_path):
    """Its name, its shape, its type, and each of its numbers."""
    readout = made(name)
    readout.save(tmp_path)
    whole = learned(tmp_path)
    for key, wanted in readout.wanted().items():
        spoilt = whole[key].copy()
        spoilt.flat[-1] = np.inf if wanted.unknown else np.nan
        for values, message in (
            (None, f"lacks {key}"),
            (whole[key][None], f"{key} is of shape"),
            (whole[key].astype(int), f"{key} is of type int64"),
            (whole[key].astype("U3"), f"{key} is of type <U3"),
            (spoilt, f"{key} holds {'Infinity' if wanted.unknown else 'NaN'}"),
        ):
            rest = {k: v for k, v in whole.items() if k != key}
            np.savez(
                tmp_path / "learned.npz", **rest | ({key: values} if values is not None else {})
            )
            with pytest.raises(SerpentError, match=rf"learned.npz.* {message}.*Train it again"):
                load(tmp_path)
    np.savez(tmp_path / "learned.npz", **whole, more=np.ones(3))
    with pytest.raises(SerpentError, match="has more, which is unknown"):
        load(tmp_path)


@pytest.mark.parametrize("name", MADE)
def test_every_setting_is_looked_at(name, tmp_path):
    readout = made(name)
    readout.save(tmp_path)
    config = json.loads((tmp_path / "readout.json").read_text())["config"]
    for key in config:
        for value in (True, "three", {}, -1e9, 10**30, float("nan"), [[]]):
            edit(tmp_path, config=config | {key: value})
            with pytest.raises(SerpentError, match=rf"readout.json.*{key}"):
                load(tmp_path)
        edit(tmp_path, config={k: v for k, v in config.items() if k != key})
        with pytest.raises(SerpentError, match=f"config lacks {key}"):
            load(tmp_path)
    edit(tmp_path, config=config | {"depth": 3})
    with pytest.raises(SerpentError, match="config has depth, which is unknown"):
        load(tmp_path)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"format_version": 99}, "format_version is 99; it must be 1"),
        ({"input_size": 98}, "takes 98 numbers per window"),
        ({"name": "gone"}, "readout.json: there is no readout 'gone'"),
        ({"name": 5}, "name is 5; it must be a text"),
        ({"rate_hz": "4"}, 'rate_hz is the text "4"'),
        ({"rate_hz": -4.0}, "rate_hz is -4.0; .* above 0 and up to 10000 Hz"),
        ({"history": [{"train_loss": 1.0}]}, r"history\[0\] lacks validation_loss, rate, seconds"),
        ({"covariance_m2": [1.0]}, "covariance_m2 is a list of 1 value"),
        ({"covariance_m2": (-np.tile(np.eye(3), (9, 1, 1))).tolist()}, "is no covariance"),
        ({"config": {"window": 10**6, "ridge": 0.0}}, "config.window is 1000000; .* to 1,000 rows"),
    ],
)
def test_what_is_not_as_a_readout_says_of_itself_is_refused(change, told, saved):
    edit(saved, **change)
    with pytest.raises(SerpentError, match=told):
        load(saved)


@pytest.mark.parametrize(
    "key", ["name", "config", "input_size", "rate_hz", "covariance_m2", "history"]
)
def test_a_missing_key_is_named(key, saved):
    about = json.loads((saved / "readout.json").read_text())
    del about[key]
    (saved / "readout.json").write_text(json.dumps(about))
    with pytest.raises(SerpentError, match=rf"readout\.json: it lacks {key}"):
        load(saved)


def test_the_settings_of_a_readout_that_is_corrected_are_looked_at(tmp_path):
    readout = made("adapted")
    readout.save(tmp_path)
    config = readout.config()
    for change, told in (
        ({"base": "gone"}, "there is no readout 'gone'"),
        ({"settings": {"window": 4}}, "config.settings lacks ridge"),
        ({"settings": {"window": 4, "ridge": -1.0}}, "config.settings.ridge is -1.0"),
    ):
        edit(tmp_path, config=config | change)
        with pytest.raises(SerpentError, match=told):
            load(tmp_path)


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (lambda path: path.write_bytes(b"PK torn"), "is not a whole .npz file"),
        (lambda path: path.unlink(), "there is no such file"),
        (lambda path: path.write_bytes(path.read_bytes()[:-30]), "is not a whole .npz file"),
        (
            lambda path: np.savez(path, slope=np.array([{}], dtype=object)),
            "no header that numpy writes",
        ),
        (lambda path: np.savez_compressed(path, slope=np.zeros(9)), "is not a whole .npz file"),
        (
            lambda path: claim(path, b"(99, 27)", b"(9999999999, 27)"),
            r"float64 of shape \(9999999999, 27\), and has 21,",
        ),
        (lambda path: claim(path, b"'<f8'", b"'<O8'"), "no header that numpy writes"),
    ],
)
def test_arrays_that_are_not_what_they_claim_are_refused(damage, told, saved):
    """Also a header that claims terabytes."""
    damage(saved / "learned.npz")
    with pytest.raises(SerpentError, match=rf"learned\.npz.*{told}"):
        load(saved)


def claim(path: Path, before: bytes, after: bytes) -> None:
    """Write the same arrays with another claim in a header of the same length."""
    with zipfile.ZipFile(path) as archive:
        members = {each.filename: archive.read(each) for each in archive.infolist()}
    raw = members["slope.npy"]
    assert before in raw
    end = raw.index(b"\n")
    header = raw[:end].replace(before, after, 1).rstrip()
    members["slope.npy"] = header.ljust(end) + raw[end:]
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def test_a_folder_without_a_readout_is_named(tmp_path):
    with pytest.raises(SerpentError, match="holds no trained readout"):
        load(tmp_path)
