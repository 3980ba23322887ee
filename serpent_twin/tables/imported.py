"""Undo what log import did to columns, for who names them as the recording had them."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from serpent_twin.tables.table import Column, DataTable
from serpent_twin.units import TO_SI

KEY = b"serpent_twin_import"
"""Metadata key of an imported log, whose value is JSON"""
TIME = "time"
"""Its one clock [s]"""


@dataclass(frozen=True)
class Conversion:
    """How a field of a recording became a column: SI value = offset + scale × value in the unit."""

    field: str
    """Its name in the recording"""
    unit: str
    """Unit of the field in the recording"""
    scale: float = 1.0
    offset: float = 0.0

    def undone(self, values: Column) -> Column:
        """A column as the recording had it, (T,)."""
        return (values - self.offset) / (self.scale * TO_SI[self.unit][0])

    @property
    def metadata(self) -> dict[str, str]:
        """What a column of Parquet keeps of it."""
        numbers = {"scale": repr(self.scale), "offset": repr(self.offset)}
        return {
            "unit": TO_SI[self.unit][1],
            "field": self.field,
            "field_unit": self.unit,
            **numbers,
        }


def conversion(metadata: Mapping[bytes, bytes]) -> Conversion | None:
    """The conversion that a column of Parquet was made by, if it says so."""
    said = {key.decode(errors="replace"): v.decode(errors="replace") for key, v in metadata.items()}
    if not said.get("field") or said.get("field_unit") not in TO_SI:
        return None
    try:
        scale, offset = float(said["scale"]), float(said["offset"])
    except (KeyError, ValueError):
        return None
    return Conversion(said["field"], said["field_unit"], scale, offset) if scale else None


def as_recorded(table: DataTable) -> tuple[dict[str, Column], dict[str, str]]:
    """Columns by the names that the recording had, in its units, and these units.

    A name that the log has stays its own, and one that two streams have is left out.
    """
    columns, conversions = table.columns, table.conversions
    once = Counter(each.field for each in conversions.values())
    new = {
        each.field: (name, each)
        for name, each in conversions.items()
        if each.field not in columns and once[each.field] == 1
    }
    found = {field: each.undone(columns[name]) for field, (name, each) in new.items()}
    return found, {field: each.unit for field, (_, each) in new.items()}
