"""Test that README and docs link to existing files, name commands that take their options, and are short."""

import functools
import re
import shlex
import subprocess
import sys
from importlib.util import find_spec

import pytest
from markdown.extensions.toc import slugify
from paths import ROOT
from readme import as_module, commands, options, pages
from typed import typed

from serpent_twin.command_line.verbs import verbs

LINK = re.compile(r"\]\((?!https?:)([^)\s#]*)(?:#([^)\s]+))?\)")
CODE = re.compile(r"`([^`\n]+)`")
IN_REPOSITORY = re.compile(
    r"(serpent_twin|bench_arm|benchmarks|experiments|model|data|docs|tests)/[\w./-]*"
)
WITH_SUBCOMMANDS = ("serpent_twin.log", "serpent_twin.mocap")
MODULES = ("serpent_twin.", "experiments.", "benchmarks.", "bench_arm")


OF_USE = [page for page in pages() if page.parent.name != "results"]
WRITTEN = [page for page in pages() if not page.with_suffix(".json").exists()]
"""Pages that people write; those beside a results.json are tables that a command writes"""


def spans():
    """Inline code of all pages."""
    return {span for page in pages() for span in CODE.findall(page.read_text())}


def abbreviated():
    """Commands that the text names by their verb, such as `trace --twins 12`."""
    names = "|".join(verb.replace(".", " ") for verb in verbs())
    verb = re.compile(rf"({names}) (\w+ )?--")
    return [as_module(f"serpent-twin {span}") for span in sorted(spans()) if verb.match(span)]


def called():
    """Each module of the documented commands, with its subcommand, and the options that it is given."""
    found = {}
    for command in [*commands(), *abbreviated()]:
        words = shlex.split(command)
        if words[:2] == ["python", "-m"] and words[2].startswith(MODULES):
            name = tuple(words[2:4] if words[2] in WITH_SUBCOMMANDS else words[2:3])
            found.setdefault(name, set()).update(set(options(words)) - {"", "--help"})
    return found


@functools.cache
def taken(name):
    """Options that the help of a command lists."""
    done = typed(*name, "--help")
    assert done.returncode == 0, done.stderr
    return set(re.findall(r"--[a-z][a-z0-9-]*", done.stdout))


def test_the_site_builds_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "index.html").exists()


def test_each_page_is_in_the_navigation_once():
    named = pages()[1:]
    assert sorted(named) == sorted((ROOT / "docs").rglob("*.md"))
    assert len(set(named)) == len(named)


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 120


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.stem)
def test_a_page_has_at_most_1500_words(page):
    assert len([word for word in page.read_text().split() if re.search(r"\w", word)]) <= 1500


@pytest.mark.parametrize("page", OF_USE, ids=lambda page: page.stem)
def test_dates_and_commits_are_in_the_results_alone(page):
    assert not re.search(r"20\d\d-\d\d-\d\d(?!T)|\bcommits? [0-9a-f]{7}", page.read_text())


@pytest.mark.parametrize("page", OF_USE, ids=lambda page: page.stem)
def test_commands_have_one_spelling(page):
    assert "python -m serpent_twin." not in page.read_text()


@pytest.mark.parametrize("name", ["README.md", "model/README.md", "data/README.md"])
def test_links_lead_to_files_and_headings_that_exist(name):
    for target, heading in LINK.findall((ROOT / name).read_text()):
        file = ((ROOT / name).parent / target).resolve()
        assert file.exists(), target
        if heading:
            titles = re.findall(r"^#+ (.+)$", file.read_text(), re.MULTILINE)
            assert heading in {slugify(title, "-") for title in titles}, (target, heading)


def test_files_that_the_pages_name_exist():
    named = {span for span in spans() if IN_REPOSITORY.fullmatch(span)}
    assert len(named) > 10
    assert {span for span in named if not (ROOT / span).exists()} == set()


def test_make_has_the_targets_that_the_pages_name():
    asked = {words[1] for c in commands() if (words := shlex.split(c))[0] == "make"}
    made = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert asked and asked <= set(made)


@pytest.mark.slow
def test_modules_of_the_commands_exist_and_take_their_options():
    found = called()
    assert len(found) > 15
    for name, given in found.items():
        assert find_spec(name[0]), name
        assert not given or given <= taken(name), (name, given - taken(name))


def test_the_examples_of_the_library_run(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "docs" / "extending.md").read_text()
    examples = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert len(examples) > 3
    for example in examples:
        exec(compile(example, "docs/extending.md", "exec"), {"__name__": "example"})
    assert capsys.readouterr().out.startswith("16.7 mm\n")
