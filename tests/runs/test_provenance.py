"""Test what results say of the code that made them."""

import subprocess

import pytest
from paths import ROOT

from serpent_twin.runs.provenance import git_commit


def test_results_name_the_commit_of_the_source_tree():
    command = ["git", "-C", str(ROOT), "rev-parse", "HEAD"]
    said = subprocess.run(command, capture_output=True, text=True)
    if said.returncode or not (ROOT / ".git").exists():
        pytest.skip("this source tree is no checkout that git reads")
    assert said.stdout.startswith(git_commit().removesuffix("-dirty"))
