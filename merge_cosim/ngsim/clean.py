"""Parsing a file's cells into numbers; an error names the cell that is not a number or not possible."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import BoolArray, FloatArray, IntArray
from merge_cosim.ngsim.formats import Source

WHOLE = ("vehicle_id", "part", "frame", "lane")
"""Canonical columns of whole numbers."""

OPTIONAL = ("length", "width")
"""Canonical columns in which a cell may be empty or zero: not logged, NaN."""

NOT_A_NUMBER = "not a number: mend or remove the row"

_NUMBER = r"^(-?((\d+|\d{1,3}(,\d{3})+)(\.\d*)?|\.\d+)([eE][-+]?\d+)?)?$"
_NOT_LOGGED = ("nan", "null", "none", "na")


@dataclass(frozen=True)
class Place:
    """Line numbers of the rows of a piece of a file.

    Attributes:
        source: The file.
        rows: Number of each row as an editor counts: lines of a text, rows of a Parquet file, from 1. Shape (n,).
    """

    source: Source
    rows: IntArray

    def error(self, row: int, what: str) -> UserError:
        """Name the place of a fault: `row` counts within the piece."""
        unit = "row" if self.source.parquet else "line"
        return UserError(f"{self.source}, {unit} {self.rows[row]}: {what}")


def numbers(cells: pa.ChunkedArray, column: str, place: Place, optional: bool = False) -> FloatArray:
    """Return a column's cells as numbers; thousands may be separated by commas.

    Args:
        cells: Texts or numbers, shape (n,).
        column: The column's name in the file.
        place: Where the rows stand.
        optional: Empty cells are allowed and become NaN.

    Raises:
        UserError: A cell is empty or not a number.
    """
    if pa.types.is_boolean(cells.type):
        raise UserError(f"{place.source}: {column} holds true and false, not numbers")
    try:
        values = pc.cast(cells, pa.float64())
    except pa.ArrowInvalid:
        values = _parse(cells, column, place)
    except pa.ArrowNotImplementedError:
        raise UserError(f"{place.source}: {column} holds {cells.type}, not numbers") from None
    result: FloatArray = values.to_numpy()
    if not optional:
        _refuse(~np.isfinite(result), cells, column, place, NOT_A_NUMBER)
    return result


def checked(cells: pa.ChunkedArray, column: str, name: str, place: Place) -> FloatArray:
    """Return the values of the canonical column `name` in SI units, after making sure that they are possible.

    Args:
        cells: Texts or numbers in the file's unit, shape (n,).
        column: The column's name in the file.
        name: The canonical column.
        place: Where the rows stand.

    Raises:
        UserError: A cell is not a number or impossible.
    """
    values = numbers(cells, column, place, optional=name in OPTIONAL)
    unit = 1.0 if name in (*WHOLE, "time") else place.source.layout.unit
    if name in WHOLE:
        _refuse(values != np.floor(values), cells, column, place, "not a whole number")
    low, high = (limit / unit for limit in place.source.layout.limits[name])
    _refuse((values < low) | (values > high), cells, column, place, f"impossible: outside {low:g} to {high:g}")
    return np.where(values > 0, values, np.nan) * unit if name in OPTIONAL else values * unit


def _parse(cells: pa.ChunkedArray, column: str, place: Place) -> pa.ChunkedArray:
    """Parse texts that may have separated thousands, blanks around them, or be empty."""
    text = pc.utf8_trim_whitespace(cells)
    good = pc.match_substring_regex(text, _NUMBER)
    empty = pc.is_in(pc.utf8_lower(text), pa.array(["", *_NOT_LOGGED]))
    _refuse(~pc.or_(good, empty).to_numpy(), cells, column, place, NOT_A_NUMBER)
    plain = pc.replace_substring(text, ",", "")
    return pc.cast(pc.if_else(empty, pa.scalar(None, pa.string()), plain), pa.float64())


def _refuse(wrong: BoolArray, cells: pa.ChunkedArray, column: str, place: Place, why: str) -> None:
    if wrong.any():
        row = int(np.argmax(wrong))
        raise place.error(row, f"{column} is {cells[row].as_py()!r}, {why}")
