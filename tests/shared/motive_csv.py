"""Write the same markers as Motive's versions do."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Dialect:
    version: str = "1.23"
    unit: str = "Meters"
    time_name: str = "Time (Seconds)"
    typed_rows: bool = True
    parent: bool = False
    timecode: bool = False
    decimals_of_time: int = 6
    locale: str = ""
    bom: bool = False
    end: str = "\r\n"
    rigid_body: bool = False
    wrong_count: bool = False


DIALECTS = {
    "1.21": Dialect("1.21", "Meters", "Time", typed_rows=False, rigid_body=True),
    "1.22": Dialect("1.22", "Millimeters", decimals_of_time=3),
    "1.23": Dialect("1.23", "Millimeters", locale=" 下午", decimals_of_time=3, rigid_body=True),
    "1.24": Dialect("1.24", "Centimeters", timecode=True, end="\n", wrong_count=True),
    "1.25": Dialect("1.25", "Meters", parent=True, bom=True, locale=" nachm. é"),
}
SCALE = {"Meters": 1.0, "Centimeters": 100.0, "Millimeters": 1000.0}


def write_take(path, frame, names, position, dialect=DIALECTS["1.23"], rate=120.0, ids=None):
    """Write markers (T, M, 3) [m]; NaN become blank cells."""
    d = dialect
    lead = 3 if d.timecode else 2
    body = ["Rotation"] * 4 + ["Position"] * 3 + [""] if d.rigid_body else []
    ghost = ["Position"] * 3 + ["Marker Quality"] if d.rigid_body else []
    extra = len(body) + len(ghost)
    count = 8622 if d.wrong_count else len(frame)
    first = (
        f"Format Version,{d.version},Take Name,Take 7{d.locale},Take Notes,,Capture Frame Rate,{rate:f},"
        f"Export Frame Rate,{rate:f},Capture Start Time,2026-08-04 03.25.40.230{d.locale},"
        f"Total Frames in Take,{count},Total Exported Frames,{count},Rotation Type,Quaternion,"
        f"Length Units,{d.unit},Coordinate Space,Global"
    )
    wide = [name for name in names for _ in range(3)]
    ids = [f"{n:032X}" for n in range(len(names))] if ids is None else ids
    blank = [""] * (lead - 1)

    def row(word, body_cells, cells):
        return ",".join([*blank, word if d.typed_rows else "", *body_cells, *cells])

    lines = [first, ""]
    lines.append(
        row(
            "Type",
            ["Rigid Body"] * len(body) + ["Rigid Body Marker"] * len(ghost),
            ["Marker"] * len(wide),
        )
    )
    lines.append(row("Name", ["B"] * len(body) + ["B:Marker1"] * len(ghost), wide))
    lines.append(row("ID", ['"F00"'] * extra, [f'"{i}"' for i in ids for _ in range(3)]))
    if d.parent:
        lines.append(row("Parent", [""] * extra, [""] * len(wide)))
    lines.append(",".join([*blank, "", *body, *ghost, *["Position"] * len(wide)]))
    body_axes = list("XYZWXYZ") + [""] + list("XYZ") + [""] if d.rigid_body else []
    timecode = ["TimeCode"] if d.timecode else []
    lines.append(",".join(["Frame", d.time_name, *timecode, *body_axes, *"XYZ" * len(names)]))
    flat = position.reshape(len(frame), -1) * SCALE[d.unit]
    body_cells = ["0.5"] * extra
    for number, values in zip(frame, flat, strict=True):
        seconds = f"{round(number / rate, d.decimals_of_time):.6f}"
        cells = ["" if np.isnan(v) else f"{v:.6f}" for v in values]
        stamp = ["15:26:46:12.02"] if d.timecode else []
        lines.append(",".join([str(number), seconds, *stamp, *body_cells, *cells]))
    text = d.end.join(lines) + d.end
    path.write_bytes((b"\xef\xbb\xbf" if d.bom else b"") + text.encode())
    return path
