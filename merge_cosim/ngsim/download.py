"""Fetching the NGSIM trajectories from the portal of the US Department of Transportation."""

import http.client
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from urllib.parse import urlsplit

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.formats import Kind, sources

PORTAL = "https://data.transportation.gov/api/views/8ect-6jqj/rows.csv?accessType=DOWNLOAD"
"""All NGSIM trajectories as one CSV, about 1.4 GB."""

UNFINISHED = ".part"
"""Ending of a file whose download is not finished."""

TIMEOUT_S = 60.0
"""Longest silence of the server [s]."""

_CHUNK = 1 << 20

Progress = Callable[[int, int | None], None]
"""Called with the bytes that are there and the bytes of the whole file, None if the server does not give it."""


def download(folder: Path, url: str = PORTAL, progress: Progress = lambda done, total: None) -> Path:
    """Fetch a trajectory file into `folder`, going on where an earlier attempt stopped if the server allows it.

    A file that is there already is not fetched again.

    Raises:
        UserError: The server cannot be reached or stops too early, or sends something else.
    """
    if urlsplit(url).scheme not in ("http", "https"):
        raise UserError(f"{url}: not an http or https address")
    target = folder / (PurePosixPath(urlsplit(url).path).name or "rows.csv")
    if target.exists():
        return target
    folder.mkdir(parents=True, exist_ok=True)
    part = target.with_name(target.name + UNFINISHED)
    try:
        _fetch(url, part, progress)
    except urllib.error.HTTPError as error:
        raise UserError(f"{url}: the server answers {error.code} {error.reason}") from None
    except urllib.error.URLError as error:
        raise UserError(
            f"{url}: cannot be reached ({error.reason}): go online, or fetch it elsewhere and copy it to {folder}"
        ) from None
    except (http.client.HTTPException, ConnectionError, TimeoutError):
        raise UserError(f"{url}: the connection broke: run the command again to go on ({part})") from None
    found = sources(part)
    if not any(source.kind is Kind.TRAJECTORIES for source in found):
        part.unlink()
        raise UserError(f"{url}: not trajectory data: {found[0].note if found else 'it is empty'}")
    return part.rename(target)


def _fetch(url: str, part: Path, progress: Progress) -> None:
    """Append to `part` what is missing of the file."""
    done = part.stat().st_size if part.exists() else 0
    request = urllib.request.Request(url, headers={"Range": f"bytes={done}-"} if done else {})
    try:
        answer = urllib.request.urlopen(request, timeout=TIMEOUT_S)
    except urllib.error.HTTPError as error:
        if done and error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            return  # nothing is missing
        raise
    with answer:
        resumed = answer.status == http.HTTPStatus.PARTIAL_CONTENT
        done = done if resumed else 0
        length = answer.headers["Content-Length"]
        total = done + int(length) if length else None
        with part.open("ab" if resumed else "wb") as file:
            while chunk := answer.read(_CHUNK):
                file.write(chunk)
                done += len(chunk)
                progress(done, total)
    if total is not None and done < total:
        raise http.client.IncompleteRead(b"", total - done)
