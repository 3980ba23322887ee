"""Find the cameras' base frame, or fill session logs from a Motive take."""

from pathlib import Path

import tyro

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.hardware.find_frame import Straight, measure
from serpent_twin.hardware.natnet_live import NatNet
from serpent_twin.sessions.merge import HEADING, Merge, merge


@tyro.conf.configure(tyro.conf.OmitArgPrefixes)
def merge_command(config: Merge) -> None:  # noqa: D103 tyro would print it above the config's own
    print(HEADING)
    for _, line in merge(config):
        print(line, flush=True)
    next_step.say(next_step.after_logs(config.folder, config.folder.parent))


@tyro.conf.configure(tyro.conf.OmitArgPrefixes)
def frame_command(config: Straight) -> None:  # noqa: D103 tyro would print it above the config's own
    rigid, labels, residual = measure(config)
    millimetres = [round(1e3 * float(r), 2) for r in residual]
    rigid.save(config.out, {"labels": labels, "residual_mm": millimetres})
    for n, (label, size) in enumerate(zip(labels, millimetres, strict=True), 1):
        print(f"marker {n} ({label}): {size:.2f} mm from its place")
    print(f"{config.out}: base frame from 9 markers, residual {1e3 * rigid.residual:.2f} mm rms")
    next_step.say(after_frame(config.out, config.natnet))


def after_frame(frame: Path, natnet: NatNet) -> next_step.Words:
    """Record a short session with cameras, or set the arm up first."""
    if not Path("arm.toml").is_file():
        return next_step.step("set up")
    cameras = ["--mocap", "natnet", *next_step.changed(natnet, NatNet())]
    return next_step.step("first run", changed=cameras, frame=frame, out=Path("first_run"))


if __name__ == "__main__":
    cli.run({"merge": merge_command, "frame": frame_command})
