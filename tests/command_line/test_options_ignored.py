"""Test that every option that a run would ignore is refused, and every other one is accepted."""

import typing
from pathlib import Path

import pytest
from configs import NEEDED, bare, configs, made, number, options
from typed import typed

from serpent_twin.arm.parameters import Parameters
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.natnet_stream import NatNet

FILE = Path("file")
NATNET = {each.name for each in NatNet.__dataclass_fields__.values()}
ARM = set(Parameters.__dataclass_fields__)
REAL = {"port", "setup", "mocap"}
MULTICAST = {"multicast_address", "data_port"}
CAMERAS = (NATNET - MULTICAST) | {"frame"}
SIM = {"push", "marker_loss", "workers", "twin"} | (ARM - {"controller_gain"})
BODY = {"delays", "memory_delay", "taps", "stretches", "washout", "repeated", "stream", "coarsest"}
POSES = {"sessions", "session_steps", "session_rate", "epochs"}
NATNET_ON = {"backend": "real", "mocap": "natnet"}

IGNORED = {
    "Collect": [
        ({}, REAL | CAMERAS | MULTICAST),
        ({"motion": FILE}, REAL | CAMERAS | MULTICAST | {"steps"}),
        ({"backend": "real"}, SIM | CAMERAS | MULTICAST),
        (NATNET_ON, SIM | MULTICAST),
        (NATNET_ON | {"multicast": True}, SIM),
    ],
    "Estimate": [
        ({}, REAL | CAMERAS | MULTICAST),
        ({"markers": False}, REAL | CAMERAS | MULTICAST | {"learn", "marker_noise"}),
        (
            {"backend": "real"},
            (SIM & ARM) | CAMERAS | MULTICAST | {"simulate", "markers", "learn", "push"},
        ),
        (NATNET_ON, (SIM & ARM) | MULTICAST | {"simulate", "markers", "push"}),
    ],
    "Follow": [
        ({}, REAL | CAMERAS | MULTICAST),
        ({"backend": "real"}, CAMERAS | MULTICAST | {"simulate", "markers", "seed"}),
        (NATNET_ON, MULTICAST | {"simulate", "markers", "seed"}),
    ],
    "Train": [
        ({}, {"adapt_windows"}),
        ({"adapt": FILE}, set()),
        ({"readout": ("linear",)}, {"adapt_windows", "twin", "epochs"}),
        ({"readout": ("linear",), "windows": "1,2"}, {"adapt_windows", "twin"}),
        ({"readout": ("observer",)}, {"adapt_windows", "epochs"}),
    ],
    "Diagnose": [({}, set())],
    "Trace": [({}, set()), ({"judge": "x"}, {"held_out"})],
    "Sweep": [
        ({}, {"epochs"}),
        ({"cluster": "tcp://x"}, {"workers", "epochs"}),
        ({"readouts": ("mlp",)}, set()),
        ({"readouts": ()}, POSES),
        ({"body": False}, BODY | {"steps", "amplitude", "rigid", "epochs"}),
        (
            {"body": False, "session_rate": 3.0},
            BODY | {"steps", "amplitude", "rigid", "epochs", "rate"},
        ),
    ],
    "Confusion": [({}, set()), ({"cluster": "tcp://x"}, {"workers"})],
    "Doctor": [({}, set()), ({"live": True}, {"reads", "out"})],
    "Zero": [({}, set())],
    "DeviceOptions": [
        ({}, {"rate_hz", "controller_gain", "marker_noise"}),
        ({"lockstep": True}, {"realtime", "cameras", "controller_gain", "marker_noise"}),
        ({"no_paced": True}, {"paced", "rate_hz", "controller_gain", "marker_noise"}),
        ({"cameras": 1510}, {"rate_hz", "controller_gain"}),
    ],
    "Merge": [({}, set()), ({"frame": FILE}, {"base_markers"})],
    "Straight": [({}, MULTICAST), ({"multicast": True}, set())],
    "StiffnessSweep": [
        ({"logs": FILE}, set()),
        ({"logs": None}, {"arms", "sessions", "twins"}),
        ({"quick": True}, {"rate", "lstm"}),
    ],
    "PaperTable": [({}, set()), ({"design": 0}, {"full", "close"})],
    "Picture": [({}, {"at"}), ({"replay": FILE}, set())],
} | {
    name: [({}, set())]
    for name in (
        "AnyModel", "AnyModelSpeed",
        "Benchmarks", "Check", "CloseTheLoop", "CollectSpeed", "Demo", "EstimateSpeed", "Plan",
        "FaultMatrix", "FollowStudy", "ForceStudy", "Fuzz", "HowOftenRight", "LinearResponses",
        "Measured", "NextMotion", "Pushes",
        "ReadoutTable", "ReferencePages", "ResultPage", "RightNames", "ShipTrace", "SimToReal",
        "Frozen", "Structure", "SweepSpeed", "TraceSpeed",
    )
}  # fmt: skip
"""What each config ignores, by what is given beside it: all else is used in that mode"""
OTHER = {
    "backend": "real", "source": "bench", "faults": ("crc",), "rate": (3.0,), "amplitude": (0.01,),
    "readout": ("mlp",), "readouts": ("mlp",), "windows": "1,2", "session_rate": 3.0, "epochs": 3,
    "command_jitter": 0.5, "start_counts": (5,), "coarsest": 0.2, "rate_hz": 5.0, "reboot": (3,),
}  # fmt: skip
"""Values other than by default that no rule makes"""
MODES = {"backend", "mocap", "markers", "lockstep", "body", "readouts", "quick", "logs", "live"}
"""Options whose other value makes another mode"""


def other(kind, name, hint, default):
    if name == "rate" and kind == "StiffnessSweep":
        return 3.0
    if name in OTHER:
        return OTHER[name]
    if isinstance(default, bool):
        return not default
    if typing.get_origin(bare(hint)) is typing.Literal:
        return next(each for each in typing.get_args(bare(hint)) if each != default)
    if isinstance(default, tuple) and default and number(hint):
        return (default[0] * 0.5 if number(hint) is float else default[0] + 1,)
    if isinstance(default, tuple):
        return ("x",)
    if number(hint):
        return default + 1 if number(hint) is int else default * 0.5 if default else 0.01
    return FILE if isinstance(default, Path) or "Path" in str(hint) else "x"


CASES = [(kind, mode, ignored) for kind, modes in IGNORED.items() for mode, ignored in modes]


def test_every_config_is_listed():
    assert set(IGNORED) == set(configs())


def _words(part):
    """Text of a part of a case, alike in every process: the order in a set is not."""
    return str(sorted(part) if isinstance(part, set) else part)[:60]


@pytest.mark.parametrize(("kind", "mode", "ignored"), CASES, ids=_words)
def test_an_option_is_used_or_refused(kind, mode, ignored):
    made(kind, **mode)
    names = {name for name, _, _ in options(configs()[kind])}
    assert ignored <= names
    for name, hint, default in options(configs()[kind]):
        if name in mode or name in NEEDED.get(kind, {}):
            continue
        given = mode | {name: other(kind, name, hint, default)}
        if name not in ignored:
            if name not in MODES:
                made(kind, **given)
            continue
        with pytest.raises(SerpentError) as refused:
            made(kind, **given)
        flag = name.replace("_", "-")
        assert str(refused.value).startswith((f"--{flag} ", f"--no-{flag} "))
        assert "leave" in str(refused.value)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (
            "collect --out out --port /dev/ttyUSB0",
            "--port is for --backend real, and this run is --backend sim: leave it out, or add "
            "--backend real.",
        ),
        ("collect --out out --setup arm.toml --mocap natnet", "--mocap is for --backend real"),
        ("collect --out out --backend real --server 10.0.0.1", "--server is for --mocap natnet"),
        (
            "collect --out out --backend real --strand-slack 0",
            "--strand-slack is for --backend sim",
        ),
        ("estimate --model m --out out --learn --no-markers", "--learn learns from markers"),
        ("train --logs logs --out out --adapt-windows 0", "--adapt-windows is for --adapt"),
        ("bus.device --rate-hz 9", "--rate-hz is for --lockstep"),
        ("mocap frame --data-port 9", "--data-port is for --multicast"),
        ("sweep --out out --no-body --steps 9", "--steps is for what the body remembers"),
    ],
)
def test_what_a_user_types_is_refused_before_anything_is_written(command, said, tmp_path):
    verb, *words = command.split()
    done = typed(f"serpent_twin.{verb}", *words, folder=tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith(f"error: {said}") and done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
