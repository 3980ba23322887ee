"""Keep the rows of a study of many arms, one line of results.jsonl each."""

from pathlib import Path
from typing import Any

from serpent_twin import stored
from serpent_twin.runs.files import json_text, write_whole


class TrialRow(stored.OpenForm, frozen=True):
    """What every row of results.jsonl has."""

    id: str
    """Of the trial"""


class Results:
    """The rows of results.jsonl by trial; the file is replaced whole after every trial."""

    def __init__(self, path: Path) -> None:
        self.path = path
        lines = stored.read_json_lines(path) if path.exists() else []
        ids = [stored.take(row, TrialRow, str(path)).id for row in lines]
        self.rows: dict[str, dict[str, Any]] = dict(zip(ids, lines, strict=True))

    @property
    def scored(self) -> list[dict[str, Any]]:
        """Rows of arms that were traced to the end."""
        return [row for row in self.rows.values() if "failed" not in row]

    @property
    def failed(self) -> dict[str, str]:
        """Why others were not; they are tried again."""
        return {n: row["failed"] for n, row in self.rows.items() if "failed" in row}

    def add(self, row: dict[str, Any]) -> None:
        """Keep a row."""
        self.rows[row["id"]] = row
        write_whole(self.path, "".join(json_text(r, indent=None) for r in self.rows.values()))
