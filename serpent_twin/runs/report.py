"""Write results as a page in HTML and in Markdown."""

import base64
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any, Self

from serpent_twin.runs.html_page import PAGE, STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

_ONE_LINE = 26
"""Characters up to which a cell of a table is set on one line"""


@dataclass(frozen=True)
class Table:
    """Rows of cells under a header; columns of numbers stand to the right."""

    header: tuple[str, ...]
    """Names of the columns"""
    rows: tuple[tuple[str, ...], ...]
    """Cells, already formatted"""
    note: str = ""
    """What a reader must know to read it"""
    marked: frozenset[int] = frozenset()
    """Rows to set in bold"""

    @classmethod
    def of(
        cls,
        rows: Iterable[Any],
        columns: Mapping[str, str | Callable[[Any], str]],
        note: str = "",
        marked: Callable[[Any], bool] = lambda row: False,
    ) -> Self:
        """A table of one line a row; each header has a function of the row, or a format of its keys."""
        several = list(rows)
        lines = tuple(
            tuple(of.format_map(row) if isinstance(of, str) else of(row) for of in columns.values())
            for row in several
        )
        return cls(
            tuple(columns),
            lines,
            note,
            frozenset(n for n, row in enumerate(several) if marked(row)),
        )

    def only(self, *header: str) -> Self:
        """The table with some of its columns."""
        which = [self.header.index(name) for name in header]
        rows = tuple(tuple(row[n] for n in which) for row in self.rows)
        return replace(self, header=header, rows=rows)

    @property
    def numeric(self) -> tuple[bool, ...]:
        """Whether each column holds numbers."""
        columns = zip(*self.rows, strict=True) if self.rows else [()] * len(self.header)
        return tuple(all(_is_number(cell) for cell in column) for column in columns)

    @property
    def styles(self) -> tuple[str, ...]:
        """How each column is set: numbers to the right, long texts on several lines."""
        several = zip(self.numeric, zip(*self.rows, strict=True), strict=True) if self.rows else ()
        return tuple(
            "number" if number else "text" if max(map(len, cells)) > _ONE_LINE else ""
            for number, cells in several
        ) or ("",) * len(self.header)


@dataclass(frozen=True)
class Figure:
    """A drawing and what it shows."""

    name: str
    """Its file is figures/NAME.png"""
    drawing: "Drawing"
    """A matplotlib figure"""
    caption: str
    """What to see in it"""


@dataclass(frozen=True)
class Section:
    """A heading, paragraphs, then tables and figures."""

    title: str
    """The heading"""
    text: str = ""
    """Paragraphs, an empty line between them"""
    blocks: tuple[Table | Figure, ...] = ()
    """Tables and figures in order"""


@dataclass(frozen=True)
class Report:
    """A page."""

    title: str
    """The page's heading"""
    lead: str
    """What was found, in a sentence or two"""
    sections: tuple[Section, ...]
    """What follows"""
    facts: Mapping[str, str] = field(default_factory=dict)
    """Where the results come from: settings, versions, hashes; at the end of the page"""


def write(report: Report, folder: Path) -> Path:
    """Write report.html, which needs no other file, report.md and figures/; returns the HTML."""
    images = _images(report)
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    for name, png in images.items():
        (folder / "figures" / f"{name}.png").write_bytes(png)
    (folder / "report.md").write_text(_markdown(report), encoding="utf-8")
    page = folder / "report.html"
    page.write_text(_html(report, images), encoding="utf-8")
    return page


def as_html(report: Report) -> str:
    """A page as HTML that needs no other file."""
    return _html(report, _images(report))


def _images(report: Report) -> dict[str, bytes]:
    """The drawings of a report as PNG, by name."""
    return {
        block.name: as_png(block.drawing)
        for section in report.sections
        for block in section.blocks
        if isinstance(block, Figure)
    }


def text_table(table: Table, widest: int = 1000) -> str:
    """The table as plain text for the screen, with cells of so many characters at most."""
    lines = [[shorten(cell, widest, placeholder=" …") if len(cell) > widest else cell for cell in row]
             for row in (table.header, *table.rows)]  # fmt: skip
    width = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(
            cell.rjust(w) if right else cell.ljust(w)
            for cell, w, right in zip(line, width, table.numeric, strict=True)
        ).rstrip()
        for line in lines
    )


def _is_number(cell: str) -> bool:
    return not cell or cell[0] in "0123456789−-+–<>±" or cell.lower() in ("nan", "none")


def versions_text(origin: Mapping[str, Any]) -> str:
    """The versions in a result's provenance, as text."""
    return ", ".join(f"{name} {number}" for name, number in origin["versions"].items())


def as_png(drawing: "Drawing") -> bytes:
    """The drawing as the bytes of a PNG file."""
    file = io.BytesIO()
    drawing.savefig(file, format="png", dpi=160, bbox_inches="tight", metadata={"Software": None})
    return file.getvalue()


def _html(report: Report, images: Mapping[str, bytes]) -> str:
    import jinja2

    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.tests |= {
        "table": lambda block: isinstance(block, Table),
    }
    sources = {
        name: "data:image/png;base64," + base64.b64encode(png).decode()
        for name, png in images.items()
    }
    return environment.from_string(PAGE).render(report=report, style=STYLE, sources=sources)


def _markdown(report: Report) -> str:
    parts = [f"# {report.title}", report.lead, sections_in_markdown(report.sections)]
    parts += ["## Where this comes from"] if report.facts else []
    parts.append("\n".join(f"- {name}: `{value}`" for name, value in report.facts.items()))
    return "\n\n".join(part for part in parts if part) + "\n"


def sections_in_markdown(sections: Sequence[Section]) -> str:
    """The sections as Markdown, without a heading where one has no title; drawings are figures/NAME.png."""
    parts = []
    for section in sections:
        parts += [section.title and f"## {section.title}", section.text]
        for block in section.blocks:
            parts.append(_table_markdown(block) if isinstance(block, Table) else _image(block))
    return "\n\n".join(part for part in parts if part)


def _image(figure: Figure) -> str:
    return f"![{figure.caption}](figures/{figure.name}.png)\n\n*{figure.caption}*"


def _table_markdown(table: Table) -> str:
    rule = ["---:" if right else "---" for right in table.numeric]
    lines = [table.header, rule, *table.rows]
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"{text}\n\n{table.note}".strip()
