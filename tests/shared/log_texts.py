"""Logs of small models as text, and a change of one column."""

import posed_models
import pytest
import swung_models


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """A log of each model, as text."""
    folder = tmp_path_factory.mktemp("logs")
    return {
        posed_models: posed_models.log(folder / "poses.csv", 0, poses=20).read_text(),
        swung_models: swung_models.log(
            folder / "swing.csv", swung_models.slow(1, 6.0), 0
        ).read_text(),
    }


def cells(column, change):
    """A change of a log: of each value of a column, by its row."""

    def changed(text):
        head, *rows = text.splitlines()
        at = head.split(",").index(column)
        table = [row.split(",") for row in rows]
        for n, row in enumerate(table):
            row[at] = str(change(n, float(row[at])))
        return "\n".join([head, *(",".join(row) for row in table)])

    return changed
