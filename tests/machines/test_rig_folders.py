"""Test that logs of one machine may lie in several folders."""

from dataclasses import replace

import pytest
from paths import DATA

from serpent_twin.errors import SerpentError
from serpent_twin.machines.arm import MACHINE
from serpent_twin.machines.rig import read_logs
from serpent_twin.sessions import read_session, write_session


@pytest.fixture
def folders(tmp_path):
    """Two folders with one session each, both of the same file name."""
    made = []
    for name, number in (("old", 1), ("new", 2)):
        session = read_session(DATA / "arm_a" / f"session_{number:02d}.parquet")[:200]
        (tmp_path / name).mkdir()
        write_session(tmp_path / name / "session_01.parquet", session)
        made.append(tmp_path / name)
    return made


def test_several_folders_are_one_machine_s_logs_in_their_order(folders):
    logs = read_logs(MACHINE, folders)
    assert [log.name for log in logs] == ["old/session_01", "new/session_01"]
    assert [log.name for log in read_logs(MACHINE, folders[:1])] == ["session_01"]
    pieces = MACHINE.open(logs).pieces(logs)
    assert list(dict.fromkeys(pieces.session)) == ["old/session_01", "new/session_01"]


def test_another_arm_s_folder_is_refused(folders):
    path = folders[1] / "session_01.parquet"
    other = read_session(path)
    path.unlink()
    write_session(path, replace(other, metadata={**other.metadata, "arm": "arm_z"}))
    with pytest.raises(SerpentError, match=r"differ in arm: .* in old/session_01, arm_z in new/"):
        read_logs(MACHINE, folders)


def test_folders_of_one_name_are_refused(folders, tmp_path):
    (tmp_path / "further").mkdir()
    folders[0].rename(tmp_path / "further" / "new")
    with pytest.raises(SerpentError, match="have the same name"):
        read_logs(MACHINE, [tmp_path / "further" / "new", folders[1]])
