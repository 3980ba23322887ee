"""Test that the pages of keys are those of the schemas that read the files."""

import re

import pytest
from paths import ROOT

from experiments.reference_pages import MACHINE, MAP, REFERENCE, pages
from serpent_twin.units import TO_SI


@pytest.mark.parametrize("name", ["machine-toml.md", "map-toml.md"])
def test_the_page_is_what_its_command_writes(name):
    again = "python -m experiments.reference_pages writes it again"
    assert (REFERENCE / name).read_text() == pages()[name], again


@pytest.mark.parametrize("forms", [MACHINE, MAP])
def test_every_key_has_a_type_and_a_meaning(forms):
    page = pages()["machine-toml.md" if forms is MACHINE else "map-toml.md"]
    for form in forms.values():
        for key in form.__struct_encode_fields__:
            (_, kind, _, meaning) = re.search(
                rf"^\| (`{key}`) \|(.*)\|(.*)\| (.+) \|$", page, re.M
            ).groups()
            assert kind.strip() and len(meaning.split()) > 2, key
    assert all(f"`{unit}`" in page for unit in TO_SI)


def test_the_errors_that_name_the_pages_name_files():
    sources = [*(ROOT / "serpent_twin").rglob("*.py"), *(ROOT / "experiments").rglob("*.py")]
    named = {
        page for path in sources for page in re.findall(r"docs/[\w./-]+\.md", path.read_text())
    }
    assert {"docs/reference/machine-toml.md", "docs/reference/map-toml.md"} <= named
    written = {page for page in named if not (ROOT / page).exists()}
    assert written <= {"docs/results/NAME.md"}
