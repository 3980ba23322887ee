"""Test that a report holds what it is given, in HTML and in Markdown."""

from matplotlib.figure import Figure as Drawing

from serpent_twin.runs import report


def test_a_page_is_escaped_and_its_numbers_stand_right(tmp_path):
    drawing = Drawing()
    drawing.subplots().plot([1, 2])
    table = report.Table(
        ("name", "mm"), (("a < b", "1.50 ± 0.2"), ("c", "")), marked=frozenset({1})
    )
    blocks = (table, report.Figure("line", drawing, "A <line>"))
    page = report.Report(
        "T & U", "Lead.", (report.Section("S", "One.\n\nTwo.", blocks),), {"seed": "0"}
    )
    html = report.write(page, tmp_path).read_text()
    assert "<h1>T &amp; U</h1>" in html and "a &lt; b" in html and "A &lt;line&gt;" in html
    assert html.count("<p>") == 2 and '<td class="number">1.50 ± 0.2</td>' in html
    assert "<td>a &lt; b</td>" in html and '<tr class="marked">' in html
    markdown = (tmp_path / "report.md").read_text()
    assert "| --- | ---: |" in markdown and "(figures/line.png)" in markdown
    assert (tmp_path / "figures" / "line.png").read_bytes().startswith(b"\x89PNG")
    assert report.text_table(table).splitlines() == ["name           mm", "a < b  1.50 ± 0.2", "c"]


def test_long_texts_wrap_and_numbers_do_not(tmp_path):
    """Wrapping makes a table of limits as wide as the page."""
    long = "gear backlash@tilt servo, hinge friction@tilt and stribeck@tilt"
    rows = (("gravity", "none", "m/s²", ""), ("gear friction@tilt", "0.224", "N m", long))
    table = report.Table(("effect", "least", "unit", "confounded with"), rows)
    assert table.styles == ("", "number", "", "text")
    section = report.Section("Limits", "", (table,))
    page = report.write(report.Report("A", "b", (section,)), tmp_path).read_text()
    assert f'<td class="text">{long}</td>' in page and '<td class="number">0.224</td>' in page
    assert report.Table(("a", "b"), ()).styles == ("", "")


def test_a_table_is_declared_column_by_column():
    rows = [{"name": "a", "mm": {"mean": 1.234}}, {"name": "b", "mm": {"mean": 2.0}}]
    columns = {
        "name": "{name}",
        "error [mm]": "{mm[mean]:.2f}",
        "twice": lambda row: str(2 * row["mm"]["mean"]),
    }
    table = report.Table.of(rows, columns, "A note.", lambda row: row["name"] == "b")
    assert table.header == ("name", "error [mm]", "twice")
    assert table.rows == (("a", "1.23", "2.468"), ("b", "2.00", "4.0"))
    assert table.marked == {1} and table.note == "A note."
    assert table.only("error [mm]", "name").rows == (("1.23", "a"), ("2.00", "b"))
    assert report.Table.of([], columns).header == table.header


def test_long_cells_are_shortened_on_the_screen():
    table = report.Table(("effect",), (("a law of many words about a joint",),))
    assert report.text_table(table, 20).splitlines()[1] == "a law of many …"
