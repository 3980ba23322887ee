"""Test that logs of one machine may lie in several folders."""

from dataclasses import replace

import pytest
from paths import DATA

from serpent_twin import machines
from serpent_twin.errors import SerpentError
from serpent_twin.identification.run import Trace, planned
from serpent_twin.machines.rig import read_logs
from serpent_twin.sessions import read_session, write_session

MACHINE = machines.find("arm")


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


def test_logs_of_another_calibration_or_clock_are_refused(folders):
    """Errors state what differs, and where: the zero of one motor; rows that are 5 % further apart."""
    path = folders[1] / "session_01.parquet"
    other = read_session(path)

    def rewritten(**changed):
        path.unlink()
        write_session(path, replace(other, **changed))

    old = read_session(folders[0] / "session_01.parquet")
    (folders[0] / "session_01.parquet").unlink()
    zeroed = {**old.metadata, "setup": {"zero": [2048] * 10}}
    write_session(folders[0] / "session_01.parquet", replace(old, metadata=zeroed))
    rewritten(metadata={**other.metadata, "setup": {"zero": [2048, 2048, 2100, *[2048] * 7]}})
    with pytest.raises(
        SerpentError, match=r"differ in zero of motor 3: 2048 in old/session_01, 2100 in new/"
    ):
        read_logs(MACHINE, folders)
    rewritten(metadata=zeroed, columns=other.columns | {"time": 1.05 * other.time})
    with pytest.raises(
        SerpentError, match=r"clocks differ: 0\.26.* s a row in new/.*, 0\.25 s in old/"
    ):
        read_logs(MACHINE, folders)


def test_folders_of_one_name_are_refused(folders, tmp_path):
    (tmp_path / "further").mkdir()
    folders[0].rename(tmp_path / "further" / "new")
    with pytest.raises(SerpentError, match="have the same name"):
        read_logs(MACHINE, [tmp_path / "further" / "new", folders[1]])


def test_files_are_held_out_by_name_wherever_they_lie(folders, tmp_path):
    """Among the logs, or in no folder of them; --sessions counts those that are fitted."""
    own, other = folders[0] / "session_02.parquet", folders[1] / "session_01.parquet"
    write_session(own, read_session(DATA / "arm_a" / "session_03.parquet")[:200])
    for held_out, training, judging in (
        ((own,), ["session_01"], ["session_02"]),
        ((other,), ["old/session_01", "old/session_02"], ["new/session_01"]),
        ((folders[1],), ["old/session_01", "old/session_02"], ["new/session_01"]),
        ((own, other), ["old/session_01"], ["old/session_02", "new/session_01"]),
    ):
        config = Trace(folders[:1], tmp_path / "out", held_out=held_out)
        found = planned(config)[1:]
        assert [[log.name for log in each] for each in found] == [training, judging]
    few = Trace(folders[:1], tmp_path / "out", held_out=(other,), sessions=1)
    assert [log.name for log in planned(few)[1]] == ["old/session_01"]
    with pytest.raises(SerpentError, match="names 2 of the 2 sessions in all"):
        planned(Trace(folders[:1], tmp_path / "out", held_out=(folders[0],)))
