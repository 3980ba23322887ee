"""Test that each form in which people bring a table is imported."""

import gzip
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from recordings import ANGLE, TABLE, TIME, angle, imported, json_mcap, table
from scipy.io import savemat

from serpent_twin.errors import SerpentError

DEGREES = np.degrees(ANGLE)


def tsv(path):
    with gzip.open(path, "wt") as file:
        file.write("t\tq\n" + "\n".join(f"{t}\t{q}" for t, q in zip(TIME, DEGREES, strict=True)))


def lists(path):
    pq.write_table(pa.table({"t": TIME, "q": [[0.0, each] for each in DEGREES]}), path)


def stamps(path):
    time = np.datetime64("2025-03-02", "ns") + np.round(1e9 * TIME).astype("m8[ns]")
    pq.write_table(pa.table({"t": time, "q": DEGREES}), path)


def arrays(path):
    np.savez(path, t=TIME, q=np.stack([0 * DEGREES, DEGREES], axis=1))


def matlab(path):
    savemat(path, {"t": TIME, "q": DEGREES})


def lines(path):
    rows = [json.dumps({"t": t, "q": [0, q]}) for t, q in zip(TIME, DEGREES, strict=True)]
    path.write_text("\n".join([*rows, '{"t": 6.0, "q']))  # cut off


@pytest.mark.parametrize(
    ("name", "write", "field"),
    [
        ("run.tsv.gz", tsv, "q"),
        ("run.parquet", lists, "q[1]"),
        ("run.parquet", stamps, "q"),
        ("run.npz", arrays, "q[1]"),
        ("run.mat", matlab, "q"),
        ("run.jsonl", lines, "q[1]"),
    ],
)
def test_a_table_of_any_kind_is_imported(tmp_path, name, write, field):
    write(tmp_path / name)
    found, log = imported(
        tmp_path, [tmp_path / name], TABLE.format("").replace('"q"', f'"{field}"')
    )
    assert found[0].name == "run"
    np.testing.assert_allclose(log["time"], TIME, atol=1e-6)
    np.testing.assert_allclose(log["elbow"], ANGLE, atol=1e-9)


def test_a_folder_of_recordings_is_imported_by_number(tmp_path):
    for name in ("run_10.csv", "run_2.csv", "more/run_3.csv"):
        table(tmp_path / "in" / name, t=TIME, q=DEGREES)
    (tmp_path / "in" / "notes.md").write_text("what was done")
    found, _ = imported(tmp_path, [tmp_path / "in"], TABLE.format(""))
    assert [each.name for each in found] == ["run_3", "run_2", "run_10"]


def test_what_a_cut_recording_has_is_imported(tmp_path):
    file = json_mcap(tmp_path / "run.mcap", ("/js", TIME, [{"q": float(q)} for q in DEGREES]))
    whole = file.read_bytes()
    text = TABLE.format('topic = "/js"').replace('time = "t"', "")
    at_end = whole.index(b'{"q": ' + str(DEGREES[200]).encode())
    file.write_bytes(whole[:at_end])
    found, log = imported(tmp_path, [file], text)
    np.testing.assert_allclose(log["elbow"], ANGLE[:200], atol=1e-9)
    assert "run.mcap ends early" in found[0].streams[0].notes[0]


def test_a_folder_of_nothing_that_is_read_is_refused(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "notes.md").touch()
    with pytest.raises(
        SerpentError, match=r"in holds nothing that can be read. There are: a LeRobot"
    ):
        imported(tmp_path, [tmp_path / "in"], TABLE.format(""))


def test_a_topic_of_a_table_is_answered(tmp_path):
    file = table(tmp_path / "run.csv", t=TIME, q=DEGREES)
    with pytest.raises(SerpentError, match="A table has no topic: leave the key out"):
        imported(tmp_path, [file], TABLE.format('topic = "/a"'))


@pytest.mark.parametrize(
    "names", [["base.pos", "elbow.pos"], {"motors": ["base.pos", "elbow.pos"]}]
)
@pytest.mark.parametrize("together", [True, False])
def test_numbers_of_a_lerobot_set_have_their_names(tmp_path, names, together):
    """Names are as versions 2 and 3 of the format list them."""
    data = tmp_path / "set" / "data" / "chunk-000"
    data.mkdir(parents=True)
    (tmp_path / "set" / "meta").mkdir()
    features = {name: {"names": names} for name in ("action", "observation.state")}
    about = {"codebase_version": "v3.0" if together else "v2.1", "fps": 50, "features": features}
    (tmp_path / "set" / "meta" / "info.json").write_text(json.dumps(about))
    both = np.stack([0 * DEGREES, DEGREES], axis=1).tolist()
    rows = {"action": both, "observation.state": both, "timestamp": TIME.astype(np.float32)}
    episodes = [pa.table(rows | {"episode_index": np.full(len(TIME), n)}) for n in (0, 1)]
    if together:
        pq.write_table(pa.concat_tables(episodes), data / "file-000.parquet")
    else:
        for n, each in enumerate(episodes):
            pq.write_table(each, data / f"episode_{n:06d}.parquet")
    text = """[[stream]]
time = "timestamp"
fields = [
    { field = "observation.state.elbow.pos", column = "q", unit = "deg" },
    { field = "action.elbow.pos", column = "told", unit = "deg" },
]
"""
    found, log = imported(tmp_path, [tmp_path / "set"], text)
    assert [each.name for each in found] == ["episode_000000", "episode_000001"]
    assert found[0].held == ("told",)
    for name in ("q", "told"):
        np.testing.assert_allclose(log[name], angle(log["time"]), atol=1e-6)
