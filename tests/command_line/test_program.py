"""Test that the installed script's commands, errors and next steps name commands as they were started."""

import subprocess
import sys

import pytest
from typed import typed

import serpent_twin
from serpent_twin import __main__ as package
from serpent_twin import next_step
from serpent_twin.command_line import program

STEP = ["serpent_twin.bus.doctor", "--port", "a b"]


@pytest.fixture
def script(monkeypatch):
    """Run the words of a command line as the installed script does."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["/somewhere/bin/serpent-twin", *words])
        with pytest.raises(SystemExit) as left:
            package.start()
            raise SystemExit(0)
        return left.value.code

    return run


def test_the_script_says_its_version(script, capsys):
    assert script("--version") == 0
    assert capsys.readouterr().out == f"serpent-twin {serpent_twin.__version__}\n"
    assert typed("serpent_twin", "--version").stdout.split()[1] == serpent_twin.__version__


def test_the_list_names_the_script(script, capsys):
    assert script() == 0
    assert "usage: serpent-twin COMMAND" in capsys.readouterr().out
    assert script("nonsense") == 1
    assert "`serpent-twin` lists them" in capsys.readouterr().err
    assert script("bus") == 1
    assert "Try serpent-twin bus device or" in capsys.readouterr().err


def test_help_names_the_command_as_it_was_typed(script, capsys):
    assert script("replay", "--help") == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert shown.startswith("usage: serpent-twin replay [-h]")
    assert "of serpent-twin trace." in shown and "python -m serpent_twin" not in shown
    assert script("log", "import", "--help") == 0
    assert capsys.readouterr().out.startswith("usage: serpent-twin log import [-h]")


def test_an_error_names_the_command_as_it_would_be_typed(script, capsys, tmp_path):
    (tmp_path / "twin.json").write_text("{}")
    words = ["--sessions", "1", "--twin", str(tmp_path / "twin.json"), "--out", str(tmp_path / "o")]
    assert script("collect", *words) == 1
    assert "`serpent-twin trace` wrote" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("started", "wanted"),
    [
        ("", "next: python -m serpent_twin.bus.doctor --port 'a b'"),
        ("python -m serpent_twin", "next: python -m serpent_twin bus doctor --port 'a b'"),
        ("serpent-twin", "next: serpent-twin bus doctor --port 'a b'"),
    ],
)
def test_a_next_step_is_typed_as_the_command_was(started, wanted):
    if not started:
        assert next_step.line(STEP) == wanted
        return
    with program.started_by(started):
        assert next_step.line(STEP) == wanted
    assert next_step.line(STEP).startswith("next: python -m serpent_twin.")


def completed(words, folder):
    """What bash offers for the last of some words."""
    command = " ".join([sys.executable, "-m", "serpent_twin"])
    line = " ".join(f"'{word}'" for word in words)
    code = f"""
serpent-twin() {{ {command} "$@"; }}
eval "$(serpent-twin completion bash)"
COMP_WORDS=(serpent-twin {line})
COMP_CWORD={len(words)}
_serpent_twin
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    done = subprocess.run(
        ["bash", "-c", code], capture_output=True, text=True, cwd=folder, check=True
    )
    assert not done.stderr
    return set(done.stdout.split())


def test_bash_completes_verbs_subcommands_options_and_files(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(package.Path(serpent_twin.__path__[0]).parent))
    (tmp_path / "logs").mkdir()
    assert completed(["tra"], tmp_path) == {"trace", "train"}
    assert completed(["bus", "d"], tmp_path) == {"device", "doctor"}
    assert completed(["log", ""], tmp_path) >= {"recover", "info", "check", "import", "export"}
    assert completed(["log", "import", "--m"], tmp_path) == {"--map", "--machine"}
    assert completed(["trace", "--held"], tmp_path) == {"--held-out"}
    assert completed(["trace", "--logs", "lo"], tmp_path) == {"logs"}


def test_zsh_reads_the_completion_of_bash():
    texts = [typed("serpent_twin.completion", shell).stdout for shell in ("bash", "zsh")]
    assert texts[1].endswith(texts[0]) and "bashcompinit" in texts[1].removesuffix(texts[0])
