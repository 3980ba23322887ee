"""Test that every number of every command is refused out of its bounds, in one sentence that names it."""

import typing
from dataclasses import is_dataclass
from math import inf, nan

import pytest
from configs import configs, made, mains, number, options
from typed import typed

from serpent_twin import env
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import number as shown
from serpent_twin.recording.options import Collect

ODD = [0, -1, nan, inf, 1e300, 1e-300, 10**300]
SENSIBLE = {
    0: {
        "seed", "seeds", "workers", "drop", "marker_loss", "command_jitter", "twins", "cameras", "reads",
        "start_counts", "slack", "damping", "load_noise", "delays", "memory_delay", "washout", "trials",
        "budget_minutes", "design", "at", "strand_stiffness", "strand_slack", "joint_friction",
        "joint_damping", "transition_velocity", "gear_friction", "servo_lag", "controller_gain",
        "marker_noise", "prior_runtime_h", "feedback", "free_hours", "count", "ids",
    },
    -1: {"start_counts"},
}  # fmt: skip
"""What each of these numbers may be; 1e-300 is as good as 0 where that is a length or the like"""
ALL = {("Trace", "sessions"), ("CloseTheLoop", "sessions"), ("StiffnessSweep", "sessions")}
"""Options of which 0 means all"""
NOT = {
    (kind, "workers")
    for kind in ("AnyModel", "Confusion", "FollowStudy", "ForceStudy", "NextMotion")
}
"""Options that have no automatic choice, unlike others of their name"""

NUMERIC = [(k, n, h) for k, kind in configs().items() for n, h, _ in options(kind) if number(h)]


def allowed(kind, name, value, whole):
    if isinstance(value, float) and whole:
        return False
    if (kind, name) in NOT:
        return False
    like = 0 if value == 1e-300 else value
    return (value == 0 and (kind, name) in ALL) or name in SENSIBLE.get(like, ())


@pytest.mark.parametrize(("kind", "name", "hint"), NUMERIC, ids=lambda each: str(each)[:20])
def test_an_odd_number_is_refused_or_makes_sense(kind, name, hint):
    several = typing.get_origin(getattr(hint, "__origin__", hint)) is tuple or "tuple" in str(hint)
    for value in ODD:
        try:
            made(kind, **{name: (value,) if several else value})
            text = ""
        except SerpentError as error:
            text = str(error)
        if allowed(kind, name, value, number(hint) is int):
            assert "; give a" not in text, (value, text)
            continue
        flag = {f"--{name.replace('_', '-')} is", f"the parameter {name} is"}
        assert any(text.startswith(each) for each in flag), (value, text)
        assert text.count(".") <= 3 and len(text) < 120, text


def test_every_command_that_takes_numbers_takes_a_checked_config():
    for where, main in mains().items():
        for hint in typing.get_type_hints(main, include_extras=True).values():
            kind = hint.__origin__ if hasattr(hint, "__metadata__") else hint
            checked = isinstance(kind, type) and issubclass(kind, Checked)
            assert checked or (number(hint) is None and not is_dataclass(kind)), where
    assert len(NUMERIC) > 100


@pytest.mark.parametrize("value", ["1e3", "abc", "9" * 5000, "nan", "1.5"])
def test_a_word_that_is_no_whole_number_is_refused_in_our_words(value, capsys):
    def main(config: Collect) -> None: ...

    with pytest.raises(SystemExit) as left:
        cli.run(main, ["--out", "x", "--steps", value])
    assert left.value.code == 1
    said = capsys.readouterr().err
    assert said.startswith("error: --steps is '") and said.endswith("give a whole number.\n")
    assert len(said) < 80 and said.count("\n") == 1


@pytest.mark.parametrize(
    "command",
    [
        "sweep --steps 0",
        "collect --steps 99999999999",
        "collect --rate-hz 1e-9",
        "collect --workers -1",
        f"collect --seed {10**300}",
    ],
)
def test_what_a_user_types_is_refused_before_anything_is_written(command, tmp_path):
    verb, flag, value = command.split()
    done = typed(f"serpent_twin.{verb}", "--out", "out", flag, value, folder=tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith(f"error: {flag} is ") and done.stderr.count("\n") == 1
    assert len(done.stderr) < 100
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "given", [{"rate_hz": -1}, {"rate_hz": nan}, {"rate_hz": 0}, {"steps": 0}, {"seed": -1}]
)
def test_an_environment_refuses_odd_numbers(given):
    (name,) = given
    with pytest.raises(SerpentError, match=f"^{name} is .*; give a"):
        env.make(**given)


@pytest.mark.parametrize("value", [10**300, -(10**400), 1e300, -inf, nan, 2**64])
def test_a_number_in_an_error_is_short(value):
    assert len(shown(value)) < 12


def test_an_error_cuts_long_numbers_that_it_quotes():
    text = f"file {10**300} and {1e300:.1f}"
    assert len(str(SerpentError(text))) < 80
    assert str(SerpentError("motor 12 at 1234567890123 ns")) == "motor 12 at 1234567890123 ns"
