"""One small set of trajectories, written in every format that NGSIM was published in."""

from pathlib import Path

from merge_cosim.ngsim.formats import TEXT_COLUMNS

HEADER = list(TEXT_COLUMNS)
PORTAL_HEADER = (
    [name.replace("v_Length", "v_length") for name in HEADER[:14]]
    + ["O_Zone", "D_Zone", "Int_ID", "Section_ID", "Direction", "Movement"]
    + [*HEADER[14:], "Location"]
)
ORIGIN = {"us-101": 1_118_846_978_900, "i-80": 1_113_433_136_100, "lankershim": 1_118_935_680_200}
PLACE = {
    "us-101": (6_451_800.0, 1_872_700.0),
    "i-80": (6_042_800.0, 2_133_500.0),
    "lankershim": (6_452_000.0, 1_873_000.0),
}

Row = dict[str, float]


def car(
    vehicle: int, frames: range, lane: int = 5, y: float = 1100.0, location: str = "us-101", origin: int | None = None
) -> list[Row]:
    """Rows of a car at a steady 40 ft/s."""
    east, north = PLACE[location]
    return [
        dict.fromkeys(HEADER, 0.0)
        | {
            "Vehicle_ID": vehicle,
            "Frame_ID": frame,
            "Total_Frames": len(frames),
            "Global_Time": (origin or ORIGIN[location]) + 100 * frame,
            "Local_X": 52.25,
            "Local_Y": round(y + 4.0 * (frame - frames[0]), 3),
            "Global_X": east,
            "Global_Y": north,
            "v_Length": 15.5,
            "v_Width": 6.0,
            "v_Class": 2,
            "v_Vel": 40.0,
            "Lane_ID": lane,
        }
        for frame in frames
    ]


def write_text(path: Path, rows: list[Row]) -> Path:
    """The original text: blanks, no header."""
    path.write_text("".join("  ".join(f"{row[name]:<8}" for name in HEADER) + "\n" for row in rows))
    return path


def write_csv(path: Path, rows: list[Row], columns: list[str] = HEADER) -> Path:
    """The same as CSV with a header."""
    lines = [",".join(columns)] + [",".join(str(row[name]) for name in columns) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_portal(path: Path, rows: list[tuple[str, Row]]) -> Path:
    """The portal's CSV: byte-order mark, 25 columns, quoted thousands."""
    lines = [",".join(PORTAL_HEADER)]
    for location, row in rows:
        cells = []
        for name in PORTAL_HEADER[:-1]:
            value = row.get("v_Length" if name == "v_length" else name)
            text = "" if value is None else f"{value:,}"
            cells.append(f'"{text}"' if "," in text else text)
        lines.append(",".join([*cells, location]))
    path.write_bytes(b"\xef\xbb\xbf" + "\n".join(lines).encode() + b"\n")
    return path
