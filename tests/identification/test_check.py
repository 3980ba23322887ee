"""The command `check`: its answer, its files, and logs that it refuses; on logs of servos and of arms."""

import json
from dataclasses import replace

import numpy as np
import pytest
from measured_logs import pendulum, write_log
from paths import DATA, ROOT

from serpent_twin import check as command
from serpent_twin.command_line import cli
from serpent_twin.sessions import read_session, write_session

ARM = DATA / "arm_a"
GAINS = (100, 300, 600)
SERVO, JAW = (
    ROOT / "experiments" / "measured" / name / "machine.toml" for name in ("xl330", "jaw")
)


@pytest.fixture(scope="module")
def servo(tmp_path_factory):
    """A folder of short runs of a servo with friction."""
    folder = tmp_path_factory.mktemp("servo")
    for n, kp in enumerate(GAINS):
        about, columns = pendulum(kp, 0.03, 0.01, 0.0, seconds=2.0, seed=n)
        write_log(folder / f"kp{kp}.parquet", about, **columns)
    return folder


def run(capsys, *words):
    """Exit status, and what is printed."""
    try:
        cli.run(command.main, list(map(str, words)), error_status=2)
        status = 0
    except SystemExit as left:
        status = int(left.code or 0)
    return status, *capsys.readouterr()


def test_the_files_hold_what_is_printed(servo, tmp_path, capsys):
    out = tmp_path / "out"
    status, printed, _ = run(capsys, "--logs", servo, "--machine", SERVO, "--out", out)
    found = json.loads((out / "identifiability.json").read_text())
    assert status == (0 if found["can_be_told"] else 1)
    assert found["sentence"] in printed
    names = [each["name"] for each in found["effects"]]
    assert "hinge_friction@horn" in names
    assert all(name.replace("_", " ") in printed for name in names)
    (friction,) = (e for e in found["effects"] if e["name"] == "hinge_friction@horn")
    assert friction["can_be_told"] and 0 < friction["limit"] < friction["typical"]
    hidden = [e["name"] for e in found["effects"] if not e["can_be_told"]]
    assert bool(hidden) == (not found["can_be_told"])
    assert [each["name"] for each in found["inputs"]] == ["servo"]
    (rubs,) = (p for p in found["parameters"] if p["name"] == "joint friction of horn")
    assert rubs["unit"] == "N m" and rubs["prior"] == pytest.approx(1.0 * 0.01, rel=1e-3)
    assert found["provenance"]["rig"] == str(SERVO)
    assert "hinge friction" in (out / "report.md").read_text()
    assert (out / "figures" / "detection_limits.png").stat().st_size > 5_000
    assert printed.rstrip().splitlines()[-1].startswith("next: python -m serpent_twin.trace --logs")


def test_another_runs_folder_is_refused(servo, tmp_path, capsys):
    (tmp_path / "note.txt").write_text("mine")
    status, _, said = run(capsys, "--logs", servo, "--machine", SERVO, "--out", tmp_path)
    assert status == 2 and str(tmp_path) in said
    assert [each.name for each in tmp_path.iterdir()] == ["note.txt"]


def test_an_empty_folder_is_an_error_of_the_user(tmp_path, capsys):
    status, _, said = run(capsys, "--logs", tmp_path)
    assert status == 2 and said.startswith("error: ") and str(tmp_path) in said


def test_an_unknown_machine_is_refused_with_those_that_there_are(tmp_path, capsys):
    status, _, said = run(capsys, "--logs", tmp_path, "--rig", "leg")
    assert status == 2 and "no rig 'leg'" in said and "arm" in said
    status, _, said = run(capsys, "--logs", tmp_path, "--rig", "jaw")
    assert status == 2 and "give --machine experiments/measured/jaw/machine.toml" in said


def changed(folder, change, files=None):
    """Copies of the committed arm's logs, each changed."""
    folder.mkdir()
    for path in sorted(ARM.glob("*.parquet"))[:files]:
        write_session(folder / path.name, change(read_session(path)))
    return folder


def test_logs_without_markers_are_refused(tmp_path, capsys):
    def blind(session):
        return session.having(marker=np.full_like(session.marker, np.nan))

    status, _, said = run(capsys, "--logs", changed(tmp_path / "blind", blind, 1))
    assert status == 2 and "marker" in said.lower()


def test_logs_of_different_machines_are_refused(servo, tmp_path, capsys):
    def rename(session):
        arm = f"arm_{session.metadata['session'] % 2}"
        return replace(session, metadata={**session.metadata, "arm": arm})

    status, _, said = run(capsys, "--logs", changed(tmp_path / "mixed", rename, 2))
    assert status == 2 and "differ in arm" in said
    status, _, said = run(capsys, "--logs", servo, "--machine", JAW)
    assert status == 2 and "no column 'spindle_position'" in said
