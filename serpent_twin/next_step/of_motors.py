"""Suggest the next command once motors or cameras were found."""

from pathlib import Path
from typing import TYPE_CHECKING

from serpent_twin.next_step.words import Words, allowed, flags
from serpent_twin.runs.files import unused

if TYPE_CHECKING:  # each command imports this module, which imports the others when it checks them
    from serpent_twin.hardware.natnet.live import NatNet
    from serpent_twin.recording.options import RealArm


def after_device(port: str) -> Words:
    """Once the simulated motors are there: examine them, with a setup of their own."""
    setup = unused(Path("sim.toml"))
    return ["serpent_twin.bus.doctor", "--port", port, "--setup", str(setup)]


def after_doctor(port: str, where: Path) -> Words | None:
    """After nothing was found against a run: a short session."""
    from serpent_twin.recording.options import RealArm

    return first_run(RealArm(port, where), ["--port", port, *_setup(where)])


def after_zero(where: Path) -> Words | None:
    """After the straight pose was set: a short session."""
    from serpent_twin.recording.options import RealArm

    return first_run(RealArm(setup=where), _setup(where))


def after_frame(out: Path, natnet: "NatNet") -> Words:
    """After the base frame was found: a short session with cameras, or the setup of the arm first."""
    from serpent_twin.recording.options import RealArm

    frame = ["--frame", str(out)] if out != RealArm().frame else []
    cameras = ["--mocap", "natnet", *flags(natnet, type(natnet)()), *frame]
    step = first_run(RealArm(mocap="natnet", natnet=natnet, frame=out), cameras)
    return step or ["serpent_twin.bus.doctor", "--help"]


def first_run(real: "RealArm", options: Words) -> Words | None:
    """Ten seconds of the real arm, or of what stands for it."""
    from serpent_twin.recording.collect import check
    from serpent_twin.recording.options import Collect

    out = unused(Path("first_run"))
    config = Collect(out, backend="real", sessions=1, steps=40, real=real)
    if not allowed(lambda: check(config)):
        return None
    few = ["--out", str(out), "--sessions", "1", "--steps", "40"]
    return ["serpent_twin.collect", "--backend", "real", *options, *few]


def _setup(path: Path) -> Words:
    from serpent_twin.recording.options import RealArm

    return ["--setup", str(path)] if path != RealArm().setup else []
