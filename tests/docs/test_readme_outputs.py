"""Test that git ignores whatever the commands of README and docs write."""

import re
import shutil
import subprocess

import pytest
from paths import ROOT

PAGES = ("README.md", "Makefile", *(str(p.relative_to(ROOT)) for p in ROOT.glob("docs/**/*.md")))
WRITTEN = re.compile(r"--(?:out|link|setup|frame|transcript)[ =](?:\./)?([\w./-]+)")
BESIDE = {"arm.toml": ("arm.toml.before", "arm.turns.json"), "sim.toml": ("sim.turns.json",)}
DEFAULTS = (
    "arm.toml",
    "frame.json",
    "logs_merged",
    "close_the_loop",
    "confusion",
    "MUJOCO_LOG.TXT",
)


def outputs():
    named = {name for page in PAGES for name in WRITTEN.findall((ROOT / page).read_text())}
    named = {name for name in named if not name.isupper()}  # a placeholder, such as OUT
    return sorted(
        named | set(DEFAULTS) | {also for n in (*named, *DEFAULTS) for also in BESIDE.get(n, ())}
    )


@pytest.mark.skipif(not shutil.which("git") or not (ROOT / ".git").exists(), reason="no checkout")
def test_git_ignores_what_the_documented_commands_write():
    paths = [path for name in outputs() for path in (name, f"{name}/a_file")]
    done = subprocess.run(
        ["git", "check-ignore", "--stdin"],
        cwd=ROOT,
        input="\n".join(paths),
        text=True,
        capture_output=True,
    )
    ignored = set(done.stdout.split())
    assert len(outputs()) > 15
    assert {name for name in outputs() if not {name, f"{name}/a_file"} & ignored} == set()
