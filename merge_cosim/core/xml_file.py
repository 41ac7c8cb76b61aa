"""Reading a user's XML file: without entities, without the network, within limits, and never further than the file."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from typing import Any, BinaryIO, cast

from lxml import etree

from merge_cosim.core.errors import UserError

LARGEST = 2 << 30
"""Most bytes that a compressed file may unpack to."""

_LIMITS: Any = {"resolve_entities": False, "no_network": True, "huge_tree": False}
_DAMAGED = (etree.XMLSyntaxError, EOFError, zlib.error, gzip.BadGzipFile)


def read_xml(file: Path, blanks: bool = True) -> etree._Element:
    """Root of an XML file, which may be compressed with gzip; without `blanks` blank text and comments are left out.

    Raises:
        UserError: The file is missing, cannot be read, is no XML, has a document type, or is too large.
    """
    content = _content(file)
    parser = etree.XMLParser(**_LIMITS, remove_blank_text=not blanks, remove_comments=not blanks)
    try:
        root = etree.fromstring(content, parser)
    except _DAMAGED as error:
        raise _refusal(file, content, error) from None
    return _plain(file, root)


def root_element(file: Path) -> etree._Element:
    """First element of an XML file with its attributes; nothing after it is looked at.

    Raises:
        UserError: As `read_xml`.
    """
    head = b""
    try:
        with _opened(file) as content:
            head = content.read(1 << 16)
            content.seek(0)
            _, root = next(etree.iterparse(content, events=("start",), **_LIMITS))
    except OSError as error:
        raise _unreadable(file, error) from None
    except (*_DAMAGED, StopIteration) as error:
        raise _refusal(file, head, error) from None
    return _plain(file, root)


def _opened(file: Path) -> BinaryIO:
    return cast(BinaryIO, gzip.open(file)) if file.suffix == ".gz" else file.open("rb")


def _content(file: Path) -> bytes:
    try:
        with _opened(file) as opened:
            content = opened.read(LARGEST + 1)
    except _DAMAGED as error:
        raise UserError(f"{file}: not a whole gzip file: {error}") from None
    except OSError as error:
        raise _unreadable(file, error) from None
    if len(content) > LARGEST:
        raise UserError(f"{file}: larger than {LARGEST >> 30} GiB when unpacked; cut it into several files")
    return content


def _unreadable(file: Path, error: OSError) -> UserError:
    return UserError(f"{file}: {'no such file' if isinstance(error, FileNotFoundError) else error.strerror or error}")


def _refusal(file: Path, content: bytes, error: Exception) -> UserError:
    if b"<!DOCTYPE" in content:
        return _with_type(file)
    reason = getattr(error, "msg", None) or str(error) or "it is empty"
    return UserError(f"{file}: not XML: {' '.join(reason.split())}")


def _plain(file: Path, root: etree._Element) -> etree._Element:
    if root.getroottree().docinfo.internalDTD is not None:
        raise _with_type(file)
    return root


def _with_type(file: Path) -> UserError:
    return UserError(f"{file}: it has a document type (<!DOCTYPE>), which may define entities; take it out")
