"""Test that the recording holds what the log, the twin and the readout hold."""

import numpy as np
import pytest
from paths import DATA
from rerun.chunk import RrdReader

from serpent_twin import readouts, replay, sessions
from serpent_twin.arm.geometry import (
    ARM,
    N_JOINTS,
    N_MOTORS,
    link_frames,
    markers,
    motor_from_joint,
)
from serpent_twin.arm.mjcf import STRANDS
from serpent_twin.effects import KNOWN
from serpent_twin.errors import SerpentError
from serpent_twin.playback import rerun_colours, rerun_recording
from serpent_twin.playback.shown import ShownSession
from serpent_twin.sim import twin, twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN

T = 24
LOST = (5, 6, 20)


def make_session(rng, lost=((2, LOST),)):
    """A slow swing on stiff cables, a marker lost now and then."""
    time = np.arange(T) * 0.25
    q = 0.25 * np.sin(0.8 * time[:, None] + np.arange(N_JOINTS))
    motor = np.column_stack([motor_from_joint(q), motor_from_joint(q)[:, -1]])
    seen = markers(q)
    for marker, rows in lost:
        seen[list(rows), marker] = np.nan
    velocity = np.gradient(motor, time, axis=0)
    load = rng.uniform(-0.2, 0.2, (T, N_MOTORS))
    about = {"schema_version": 1, "backend": "sim", "arm": "swing", "session": 1, "rate_hz": 4.0}
    arrays = time, motor, velocity, load, velocity, q, seen
    return sessions.Session(None, about, dict(zip(sessions.FIELDS, arrays, strict=True)))


def column(path, entity, component):
    """Rows of one component on the recording's two timelines: steps, seconds, values."""
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            if component in batch.schema.names:
                seconds = batch["time"].cast("int64").to_numpy() * 1e-9
                return batch["step"].to_numpy(), seconds, batch[component].to_pylist()
    raise AssertionError(f"{entity} has no {component}")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A session file, a saved readout, and the recording that the command makes of both."""
    folder = tmp_path_factory.mktemp("replay")
    session = make_session(np.random.default_rng(0))
    sessions.write_session(folder / "session_01.parquet", session)
    readouts.find("analytical")().save(folder / "analytical")
    replay.main(folder / "session_01.parquet", folder / "swing.rrd", folder / "analytical")
    moved = twin.replay_motors(session.time, session.motor_position)
    return folder, session, moved


def test_measured_markers_are_those_of_the_log(made):
    folder, session, _ = made
    for i in range(N_JOINTS):
        entity = f"/markers/measured/marker{i + 1}"
        step, seconds, points = column(folder / "swing.rrd", entity, "Points3D:positions")
        assert np.array_equal(step, np.arange(T)) and np.allclose(seconds, session.time)
        for row in range(T):
            if i == 2 and row in LOST:
                assert points[row] == []
            else:
                assert np.allclose(points[row][0], session.marker[row, i], atol=1e-7)


def test_estimated_markers_are_the_readout_s_and_start_with_a_whole_window(made):
    folder, session, _ = made
    shown = ShownSession(folder / "swing.parquet", session, folder / "analytical", None)
    guess = shown.guess
    assert guess.row[0] == readouts.load(folder / "analytical").window - 1
    entity = "/markers/estimated/marker9"
    step, _, points = column(folder / "swing.rrd", entity, "Points3D:positions")
    assert np.array_equal(step, guess.row)
    assert np.allclose(
        np.array(points)[:, 0], markers(session.joint_target)[guess.row, 8], atol=1e-6
    )


def test_links_stand_where_the_twin_has_them(made):
    folder, _, moved = made
    origin, rotation = link_frames(moved.joint_angle)
    for i in (0, 8):
        entity = f"/arm/link{i + 1}"
        _, _, place = column(folder / "swing.rrd", entity, "Transform3D:translation")
        _, _, turn = column(folder / "swing.rrd", entity, "Transform3D:quaternion")
        assert np.allclose(np.array(place)[:, 0], origin[:, i], atol=1e-6)
        x, y, z, w = np.array(turn)[:, 0].T
        seen_x = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)], -1)
        assert np.allclose(seen_x, rotation[:, i, :, 0], atol=1e-6)


def test_curves_hold_loads_tensions_and_errors(made):
    folder, session, moved = made
    path = folder / "swing.rrd"
    _, _, load = column(path, "/plots/load/motor3", "Scalars:scalars")
    assert np.allclose(np.array(load)[:, 0], 100 * session.motor_load[:, 2])
    for n, name in enumerate(STRANDS):
        _, _, tension = column(path, f"/plots/tension/{name}", "Scalars:scalars")
        assert np.allclose(np.array(tension)[:, 0], moved.tension[:, n])
    _, _, error = column(path, "/plots/error/twin", "Scalars:scalars")
    far = np.linalg.norm(moved.marker - session.marker, axis=-1)
    assert np.allclose(np.array(error)[:, 0], 1e3 * np.nanmean(far, axis=-1))
    _, _, exact = column(path, "/plots/error/analytical", "Scalars:scalars")
    assert np.max(exact) < 1e-3  # mm: the session was made on stiff cables


def test_a_cable_is_blue_where_slack_and_red_where_tightest(made):
    folder, _, moved = made
    full = rerun_colours.full_tension(moved.tension)
    n = int(moved.tension.max(0).argmax())
    entity = f"/arm/base/{STRANDS[n]}"
    _, _, packed = column(folder / "swing.rrd", entity, "LineStrips3D:colors")
    rgb = np.array([[(word[0] >> shift) & 255 for shift in (24, 16, 8)] for word in packed])
    slack, tight = moved.tension[:, n] == 0, moved.tension[:, n] >= full
    assert tight.any() and (rgb[tight, 0] > rgb[tight, 2]).all()
    assert (rgb[slack, 2] > rgb[slack, 0]).all()
    blue, red = rerun_colours.tension_colour(np.array([0.0, full]), full)
    assert blue[2] > blue[0] and red[0] > red[2]


def test_every_body_has_its_meshes_and_every_strand_its_lines(made):
    folder, _, _ = made
    paths = {chunk.entity_path for chunk in RrdReader(folder / "swing.rrd").stream().to_chunks()}
    assert {f"/arm/link{i}/link{i}_body" for i in range(1, 10)} <= paths
    assert {"/arm/base/base_frame", "/arm/jaw/jaw_body", "/arm/motor10/motor10_horn"} <= paths
    for name in STRANDS:
        j = int(name[5:].split("_")[0])
        bodies = ["base", *(f"link{i + 1}" for i in range(min(j, N_JOINTS)))]
        bodies += ["jaw"] if j == N_MOTORS else []
        assert {
            path.split("/")[2] for path in paths if path.endswith(f"/{name}") and path[1] == "a"
        } == set(bodies)


def test_the_same_command_keeps_the_recording(made, capsys):
    folder, _, _ = made
    path = folder / "swing.rrd"
    before = path.read_bytes(), path.stat().st_mtime_ns
    replay.main(folder / "session_01.parquet", path, folder / "analytical")
    assert (path.read_bytes(), path.stat().st_mtime_ns) == before
    assert "Driving" not in capsys.readouterr().out


@pytest.mark.parametrize("change", ["other inputs", "foreign file"])
def test_another_file_is_never_overwritten(made, tmp_path, change):
    folder, _, _ = made
    path = tmp_path / "here.rrd"
    path.write_bytes((folder / "swing.rrd").read_bytes() if change == "other inputs" else b"mine")
    before = path.read_bytes()
    with pytest.raises(SerpentError, match=r"here\.rrd exists"):
        replay.main(folder / "session_01.parquet", path)
    assert path.read_bytes() == before


def test_a_recording_needs_its_ending(made, tmp_path):
    with pytest.raises(SerpentError, match=r"name it FILE\.rrd"):
        replay.main(made[0] / "session_01.parquet", tmp_path / "here.mp4")


def test_lost_markers_leave_gaps_in_the_recording(tmp_path):
    lost = tuple((marker, range(T)) for marker in range(N_JOINTS))
    session = make_session(np.random.default_rng(1), lost)
    moved = twin.replay_motors(session.time, session.motor_position)
    rerun_recording.write(tmp_path / "blind.rrd", session, moved)
    _, _, points = column(tmp_path / "blind.rrd", "/markers/measured/marker1", "Points3D:positions")
    assert points == [[]] * T


def test_a_known_force_is_an_arrow_from_the_middle_of_its_link_while_it_acts(tmp_path):
    session = make_session(np.random.default_rng(1))
    acts = np.arange(T) % 3 == 1
    known = {
        "push_link": 6.0 * acts,
        "push_x": 0.5 * acts,
        "push_y": -1.0 * acts,
        "push_z": 0.0 * acts,
    }
    session = session.having(**known)
    moved = twin.replay_motors(session.time, session.motor_position)
    rerun_recording.write(tmp_path / "pushed.rrd", session, moved)
    _, _, vectors = column(tmp_path / "pushed.rrd", "/arm/push", "Arrows3D:vectors")
    _, _, origins = column(tmp_path / "pushed.rrd", "/arm/push", "Arrows3D:origins")
    origin, rotation = link_frames(moved.joint_angle)
    middle = origin[:, 5] + 0.0275 * rotation[:, 5, :, 0]
    for row in range(T):
        assert len(vectors[row]) == len(origins[row]) == acts[row]
        if acts[row]:
            assert np.allclose(vectors[row][0], [0.05, -0.1, 0.0], atol=1e-6)
            assert np.allclose(origins[row][0], middle[row], atol=1e-6)


def test_a_log_of_another_arm_replays(tmp_path):
    path = DATA / "arm_a/session_04.parquet"
    session = sessions.read_session(path)[:60]
    moved = twin.replay_motors(session.time, session.motor_position)
    rerun_recording.write(tmp_path / "bench.rrd", session, moved, arm=ARM)
    step, _, points = column(tmp_path / "bench.rrd", "/markers/twin/marker9", "Points3D:positions")
    assert len(step) == 60 and np.allclose(np.array(points)[:, 0], moved.marker[:, 8], atol=1e-6)


@pytest.fixture(scope="module")
def overlaid(tmp_path_factory):
    """A session of an arm with a payload, its twin.json, and the recording of both."""
    folder = tmp_path_factory.mktemp("overlaid")
    heavy = NOMINAL_TWIN.with_effect(KNOWN["payload"](0.1))
    twin_model.write(folder / "twin.json", heavy, {"arm": "swing"})
    session = make_session(np.random.default_rng(2))
    moved = twin.replay_motors(session.time, session.motor_position, heavy)
    session = session.having(marker=moved.marker.copy())
    session.marker[list(LOST), 2] = np.nan
    sessions.write_session(folder / "session_01.parquet", session)
    replay.main(folder / "session_01.parquet", folder / "both.rrd", twin=folder / "twin.json")
    return folder, session, moved


def test_nominal_and_corrected_twin_are_laid_over_the_measured_arm(overlaid):
    folder, session, moved = overlaid
    nominal = twin.replay_motors(session.time, session.motor_position)
    for name, did in (("nominal_twin", nominal), ("corrected_twin", moved)):
        path = f"/markers/{name}/marker9"
        _, _, points = column(folder / "both.rrd", path, "Points3D:positions")
        assert np.allclose(np.array(points)[:, 0], did.marker[:, 8], atol=1e-6)
        _, _, lines = column(folder / "both.rrd", f"/markers/{name}/chain", "LineStrips3D:strips")
        assert np.allclose(np.array(lines)[:, 0, 1:], did.marker, atol=1e-6)
        _, _, error = column(folder / "both.rrd", f"/plots/error/{name}", "Scalars:scalars")
        far = np.linalg.norm(did.marker - session.marker, axis=-1)
        assert np.allclose(np.array(error)[:, 0], 1e3 * np.nanmean(far, axis=-1))
        assert (np.max(error) < 1e-6) == (name == "corrected_twin")
    _, _, lines = column(folder / "both.rrd", "/markers/measured/chain", "LineStrips3D:strips")
    assert [len(strips[0]) for strips in lines] == [9 if n in LOST else 10 for n in range(T)]


def test_pose_and_tensions_are_the_corrected_twin_s(overlaid):
    folder, _, moved = overlaid
    _, _, place = column(folder / "both.rrd", "/arm/link9", "Transform3D:translation")
    assert np.allclose(np.array(place)[:, 0], link_frames(moved.joint_angle)[0][:, 8], atol=1e-6)
    _, _, tension = column(folder / "both.rrd", f"/plots/tension/{STRANDS[0]}", "Scalars:scalars")
    assert np.allclose(np.array(tension)[:, 0], moved.tension[:, 0])


def test_a_recording_is_of_one_corrected_twin(overlaid, tmp_path, capsys):
    folder, _, _ = overlaid
    again = folder / "session_01.parquet", folder / "both.rrd"
    replay.main(*again, twin=folder / "twin.json")
    assert "Driving" not in capsys.readouterr().out
    twin_model.write(tmp_path / "twin.json", NOMINAL_TWIN, {})
    for other in (None, tmp_path / "twin.json"):
        with pytest.raises(SerpentError, match=r"both\.rrd exists"):
            replay.main(*again, twin=other)


def test_the_twin_of_another_arm_is_refused(overlaid, tmp_path):
    folder, _, _ = overlaid
    twin_model.write(tmp_path / "twin.json", NOMINAL_TWIN, {"arm": "arm_b"})
    for twin_file, message in (
        (tmp_path / "twin.json", r"is the twin of the arm arm_b, and .* is of the arm swing"),
        (tmp_path / "twin.xml", r"Give the twin\.json that"),
    ):
        with pytest.raises(SerpentError, match=message):
            replay.main(folder / "session_01.parquet", tmp_path / "a.rrd", twin=twin_file)
    assert not (tmp_path / "a.rrd").exists()
