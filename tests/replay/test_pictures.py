"""Test that pictures and videos of a session show its markers where they were, without a display."""

import subprocess
import sys
from ctypes.util import find_library

import numpy as np
import pytest
from PIL import Image
from session_log import make_session

from serpent_twin import replay
from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import markers
from serpent_twin.errors import SerpentError
from serpent_twin.playback import drawn_arm, moments, offscreen, video
from serpent_twin.playback.drawn_arm import DrawnPose, Markers
from serpent_twin.sessions import write_session

GREEN = (70, 215, 120)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return write_session(tmp_path_factory.mktemp("logs") / "session_01.parquet", make_session(30))


@pytest.fixture(scope="module")
def pencil():
    try:
        with drawn_arm.pencil(fine=False) as drawing:
            yield drawing
    except SerpentError as error:
        pytest.skip(f"no OpenGL without a display here: {error}")


def seen_at(point):
    """Pixel (column, row) of a point of the base frame, by the camera's projection."""
    model = mjcf.build(drawn=True).compile()
    azimuth, elevation = np.radians([drawn_arm._AZIMUTH, drawn_arm._ELEVATION])
    towards = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    right = np.cross(towards, [0, 0, 1])
    right /= np.linalg.norm(right)
    up = np.cross(right, towards)
    eye = np.array(drawn_arm._LOOK_AT) - drawn_arm._DISTANCE * towards
    ray = mjcf.world_from_base() @ point - eye
    width, height = drawn_arm.SIZE
    scale = height / 2 / np.tan(np.radians(model.vis.global_.fovy) / 2) / (ray @ towards)
    return width / 2 + scale * (ray @ right), height / 2 - scale * (ray @ up)


def test_a_marker_is_drawn_where_the_camera_would_see_it(pencil):
    joint = np.full(9, 0.12)
    place = np.full((9, 3), np.nan)
    place[8] = markers(joint)[8] + [0.0, 0.0, 0.06]
    pose = DrawnPose(np.r_[np.cumsum(joint), 0.0], joint, 0.0)
    with_it, without = (
        pencil.picture("a pose", pose, [Markers("measured", GREEN, each)]).astype(int)
        for each in (place, np.full((9, 3), np.nan))
    )
    strip = with_it.shape[0] - drawn_arm.SIZE[1]
    changed = np.abs(with_it - without).sum(axis=-1)[strip:]
    column, row = (round(each) for each in seen_at(place[8]))
    assert changed[row - 2 : row + 3, column - 2 : column + 3].min() > 60
    assert not changed[:, : min(column, 300) - 30].any()


def test_a_moment_names_each_source_and_its_distance(log):
    shown = moments.ShownSession.read(log, None, None)
    named = {each.name: each for each in moments.markers(shown, 7)}
    assert next(iter(named)) == "measured"
    measured, nominal = named.values()
    far = 1e3 * np.nanmean(np.linalg.norm(nominal.place - measured.place, axis=-1))
    assert nominal.name == f"nominal twin: markers {far:.1f} mm off"


def test_a_video_shows_rows_evenly_and_only_of_its_part(log):
    shown = moments.ShownSession.read(log, None, None)
    clock = shown.session.time
    assert video.frames(shown).tolist() == list(range(30))
    some = video.frames(shown, (float(clock[4]), float(clock[9])))
    assert some.tolist() == [4, 5, 6, 7, 8, 9]
    with pytest.raises(SerpentError, match="two times that rise"):
        video.frames(shown, (float(clock[4]), float(clock[4])))


def test_a_picture_is_written_once_and_nothing_else_is_overwritten(log, pencil, tmp_path, capsys):
    out = tmp_path / "a" / "b.png"
    replay.main(log, out, png="3")
    assert Image.open(out).size == (720, 720 + 2 * ((3 * 24 + 20) // 2))
    assert "next: python -m serpent_twin.replay" in capsys.readouterr().out
    made = out.stat().st_mtime_ns
    replay.main(log, out, png="3")
    assert out.stat().st_mtime_ns == made
    with pytest.raises(SerpentError, match="is not the picture of this moment"):
        replay.main(log, out, png="5")


def test_a_video_is_written_whole(log, pencil, tmp_path):
    pytest.importorskip("imageio_ffmpeg", reason="the extra view is not installed")
    out = tmp_path / "a.mp4"
    replay.main(log, out, mp4=True, between=("1.0", "1.5"))
    import imageio_ffmpeg

    found = next(imageio_ffmpeg.read_frames(str(out)))
    assert found["size"] == (720, 812) and found["codec"] == "h264"
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"png": 1e4}, "10000 s was asked for"),
        ({"png": 1.0, "mp4": True}, "--png and --mp4 are two files"),
        ({"png": 1.0, "out": "a.rrd"}, "name it FILE.png"),
        ({"mp4": True, "out": "a.rrd"}, "name it FILE.mp4"),
        ({"png": 1.0, "view": True}, "--view opens a recording"),
        ({"png": 1.0, "between": (1.0, 2.0)}, "Give it with --mp4"),
        ({}, "--out is missing"),
    ],
)
def test_what_contradicts_itself_is_refused(more, said, log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if "out" in more:
        more = more | {"out": tmp_path / more["out"]}
    with pytest.raises(SerpentError) as error:
        replay.main(log, **more)
    assert said in str(error.value)
    assert not list(tmp_path.iterdir())


def test_without_opengl_one_sentence_says_what_to_install(log, tmp_path):
    code = (
        "import ctypes.util, sys; ctypes.util.find_library = lambda _: None\n"
        "from serpent_twin.command_line import cli; from serpent_twin import replay\n"
        f"sys.argv = ['replay', {str(log)!r}, '--png', '1', '--out', 'a.png']\n"
        "cli.run(replay.main)"
    )
    env = {"PATH": "", "PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, env=env
    )
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "neither EGL nor OSMesa is here. Install a software OpenGL" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(bool(find_library("OSMesa")), reason="OSMesa is installed here")
def test_a_library_that_mujoco_gl_names_and_is_not_there_is_one_sentence(log, tmp_path):
    command = [sys.executable, "-m", "serpent_twin.replay", str(log), "--png", "1"]
    env = {"PATH": "", "PYTHONPATH": ":".join(sys.path), "MUJOCO_GL": "osmesa"}
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=env)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "no picture can be rendered with OSMESA here. Install a software OpenGL" in done.stderr


def test_mujoco_gl_chooses_and_a_library_that_fails_is_named(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert offscreen.backend() == "osmesa"
    monkeypatch.setattr(offscreen.importlib, "import_module", lambda name: object())
    with pytest.raises(SerpentError, match="rendered with OSMESA here"):
        with offscreen.opengl(4, 4):
            pass
