"""Show a session as a recording, a picture or a video: `python -m serpent_twin.replay`."""

import subprocess
import sys
from math import inf, nan
from pathlib import Path
from typing import Annotated

import tyro

import serpent_twin.command_line.mujoco_first  # noqa: F401
from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.errors import SerpentError

_Optional = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")]
_Time = Annotated[str | None, tyro.conf.arg(metavar="T", help_behavior_hint="")]
_Part = Annotated[tuple[str, str] | None, tyro.conf.arg(metavar="BEGIN END", help_behavior_hint="")]


def main(
    session: Annotated[Path, tyro.conf.Positional],
    out: _Optional = None,
    readout: _Optional = None,
    twin: _Optional = None,
    view: bool = False,
    png: _Time = None,
    mp4: bool = False,
    between: _Part = None,
) -> None:
    """Show a session: arm, cables, markers, loads, errors as a recording for rerun; or a picture or a video.

    Of an imported log of another machine, its columns over time. Pictures and videos need no display.

    Args:
        session: The session log, such as DIR/session_01.parquet, or an imported one.
        out: The file to write: FILE.rrd; with --png FILE.png, with --mp4 FILE.mp4, by default named after the
            session and in the working folder. A file that is there is never overwritten.
        readout: A trained readout to show beside the measurement, such as OUT/models/mlp.
        twin: A corrected twin to lay over the nominal one, OUT/twin.json of python -m serpent_twin.trace.
        view: Open the recording in the viewer.
        png: Draw a picture of this time of the session [s] in place of a recording.
        mp4: Draw a video of 20 s in place of a recording.
        between: The part of the session that the video shows [s]; by default all.
    """
    moment = None if png is None else _seconds(png, "--png")
    part = between and (_seconds(between[0], "--between"), _seconds(between[1], "--between"))
    kind = _kind(moment, mp4)
    _require_options(kind, view, part)
    out = _named(session, out, kind, moment)
    if kind == ".rrd":
        from serpent_twin.playback.recording import play_back  # rerun is slow to import

        said = play_back(session, out, readout, twin)
        print("\n".join(filter(None, (said, f"{out}: what rerun shows"))))
        if view:
            _open(out)
        next_step.say(next_step.after_replay(out))
        return
    _draw(session, out, readout, twin, moment, part)
    next_step.say(next_step.replay(session, out.parent, readout, twin))


def _seconds(word: str, flag: str) -> float:
    """A time of the session [s]."""
    try:
        seconds = float(word)
    except ValueError:
        seconds = nan
    if not 0 <= seconds < inf:
        raise SerpentError(f"{flag} is {word!r}; give a time of the session in s, such as 12.5.")
    return seconds


def _kind(png: float | None, mp4: bool) -> str:
    """Ending of the file to write."""
    if png is not None and mp4:
        raise SerpentError("--png and --mp4 are two files. Give one of them, then the other.")
    return ".png" if png is not None else ".mp4" if mp4 else ".rrd"


def _require_options(kind: str, view: bool, between: tuple[float, float] | None) -> None:
    if view and kind != ".rrd":
        raise SerpentError("--view opens a recording. Leave it out with --png and --mp4.")
    if between and kind != ".mp4":
        raise SerpentError("--between is the part that a video shows. Give it with --mp4.")


def _named(session: Path, out: Path | None, kind: str, png: float | None) -> Path:
    """The file to write, of the ending that its kind has."""
    if out is None and kind == ".rrd":
        raise SerpentError("--out is missing: give the recording to write, FILE.rrd.")
    if out is None:
        moment = f"_at_{png:g}_s" if png is not None else ""
        return Path(f"{session.resolve().parent.name}_{session.stem}{moment}{kind}")
    if out.suffix != kind:
        made = {
            ".rrd": "rerun knows its recordings by their ending; name it FILE.rrd, or give --png or --mp4",
            ".png": "--png makes a picture; name it FILE.png",
            ".mp4": "--mp4 makes a video; name it FILE.mp4",
        }
        raise SerpentError(f"--out {out}: {made[kind]}.")
    return out


def _draw(
    session: Path,
    out: Path,
    readout: Path | None,
    twin: Path | None,
    png: float | None,
    between: tuple[float, float] | None,
) -> None:
    """Write a picture or a video."""
    from serpent_twin.exchange import imported_log
    from serpent_twin.playback.picture import draw_picture
    from serpent_twin.playback.shown import ShownSession
    from serpent_twin.playback.video import draw_video

    if imported_log.is_other(session):
        raise SerpentError(
            f"{session} is a log of another machine, and pictures and videos show the arm. Its columns are "
            "in a recording: leave out --png and --mp4, and give --out FILE.rrd."
        )
    shown = ShownSession.read(session, readout, twin)
    if png is not None:
        draw_picture(shown, png, out)
    else:
        draw_video(shown, out, between)
    what = "the video" if png is None else "the picture"
    print("\n".join(filter(None, (shown.membership, f"{out}: {what}"))))


def _open(out: Path) -> None:
    if subprocess.run([sys.executable, "-m", "rerun", str(out)], check=False).returncode:
        raise SerpentError(
            f"the viewer could not be opened here; {out} is whole. "
            "Take it to a machine with a display and run `rerun FILE` there."
        )


if __name__ == "__main__":
    cli.run(main)
