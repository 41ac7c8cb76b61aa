"""Reading a file in blocks: a few are worked on at a time, so memory does not grow with the file."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.formats import Source, open_text

BLOCK_BYTES = 1 << 24
"""Text that is read from a file at once [bytes]."""

BLOCK_ROWS = 1 << 18
"""Parquet rows that are read at once."""

THREADS = 2
"""Blocks that are worked on at the same time; more hardly help, and each holds a block in memory."""

Result = TypeVar("Result")
_Block = tuple[int, bytes | pa.Table]


def map_blocks(source: Source, columns: list[str], work: Callable[[pa.Table, int], Result]) -> Iterator[Result]:
    """Apply `work` to each block of a file, in order.

    Args:
        source: The file.
        columns: The columns to read, as the file spells them; those of a text file are texts.
        work: Called with a block and the number of its first row: line of a text, row of a Parquet file, from 1.

    Raises:
        UserError: The file is cut short or damaged.
    """

    def convert(block: _Block) -> Result:
        first, content = block
        return work(_parse_text(content, first, source, columns) if isinstance(content, bytes) else content, first)

    return _in_order(convert, _parquet_blocks(source, columns) if source.parquet else _text_blocks(source))


def _in_order(work: Callable[[_Block], Result], blocks: Iterator[_Block]) -> Iterator[Result]:
    """Work on a few blocks at a time and yield the results in the blocks' order."""
    waiting: deque[Future[Result]] = deque()
    with ThreadPoolExecutor(THREADS) as pool:
        try:
            for block in blocks:
                waiting.append(pool.submit(work, block))
                if len(waiting) > THREADS:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


def _parquet_blocks(source: Source, columns: list[str]) -> Iterator[_Block]:
    """Yield the number of its first row (from 1) and the rows of each block of a Parquet file."""
    first = 1
    try:
        file = pq.ParquetFile(source.path)
        for batch in file.iter_batches(BLOCK_ROWS, columns=columns):
            yield first, pa.Table.from_batches([batch])
            first += batch.num_rows
        if first != file.metadata.num_rows + 1:  # with a wrong number in a column's metadata there are no batches
            raise pa.ArrowInvalid
    except (pa.ArrowInvalid, OSError):
        raise UserError(f"{source}: damaged or cut short: download or copy it again") from None


def _text_blocks(source: Source) -> Iterator[_Block]:
    """Yield the number of its first line (from 1) and the bytes of each block of whole lines, without the header."""
    with open_text(source.path, source.member) as file:
        first = 1
        if source.header:
            file.readline()
            first = 2
        while block := file.read(BLOCK_BYTES):
            block += file.readline()
            yield first, block
            first += block.count(b"\n")


def _is_text(block: bytes) -> bool:
    """Whether bytes are UTF-8; pyarrow returns no rows of other bytes."""
    try:
        return block.isascii() or bool(block.decode())
    except UnicodeDecodeError:
        return False


def _parse_text(block: bytes, first: int, source: Source, columns: list[str]) -> pa.Table:
    """Split lines and return the chosen columns as texts."""
    if source.blanks:
        block = b"\n".join(b",".join(line.split()) for line in block.splitlines())
    bad: list[pa.csv.InvalidRow] = []

    def refuse(row: pa.csv.InvalidRow) -> str:
        bad.append(row)
        return "error"

    try:
        return pa.csv.read_csv(
            pa.BufferReader(block),
            pa.csv.ReadOptions(use_threads=False, column_names=source.columns, block_size=len(block) + 1),
            pa.csv.ParseOptions(invalid_row_handler=refuse if _is_text(block) else None),
            pa.csv.ConvertOptions(include_columns=columns, column_types=dict.fromkeys(columns, pa.string())),
        )
    except pa.ArrowInvalid as error:
        if not bad:
            raise UserError(f"{source}, from line {first} on: {str(error).splitlines()[0]}") from None
        line, row = first + bad[0].number - 1, bad[0]
        raise UserError(
            f"{source}, line {line}: {row.actual_columns} columns instead of {row.expected_columns}: "
            "the file is cut short or damaged, download or copy it again"
        ) from None
