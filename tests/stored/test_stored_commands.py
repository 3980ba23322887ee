"""Test that a command that is given a damaged file prints one sentence."""

import pytest
from refusals import FOREIGN
from typed import typed

COMMANDS = {
    "collect --out {new} --sessions 1 --steps 4 --twin {file}": "twin.json",
    "collect --out {new} --sessions 1 --steps 4 --backend real --setup {file}": "arm.toml",
    "bus.doctor --setup {file}": "arm.toml",
    "log info {file}": "session_01.parquet",
    "estimate --model {folder} --out {new}": "readout.json",
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_says_it_in_one_sentence(command, tmp_path):
    path = tmp_path / COMMANDS[command]
    path.write_bytes(b"[" * 100_000)
    words = command.format(file=path, folder=tmp_path, new=tmp_path / "new").split()
    done = typed(f"serpent_twin.{words[0]}", *words[1:], folder=tmp_path)
    assert done.returncode == (2 if words[0] == "log" else 1), done.stderr
    said = done.stderr.replace(str(tmp_path), "")
    assert said.startswith("error: ") and said.count("\n") == 1 and path.name in said
    assert not FOREIGN.search(said), said
