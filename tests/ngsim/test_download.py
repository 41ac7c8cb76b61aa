import functools
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from ngsim_files import car, write_csv

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.download import download


class Server(BaseHTTPRequestHandler):
    """Serve one content, with or without resuming; `cut` ends the first answer early."""

    def __init__(self, content, resumable, cut, asked, *rest):
        self.content, self.resumable, self.cut, self.asked = content, resumable, cut, asked
        super().__init__(*rest)

    def do_GET(self):
        if self.path != "/rows.csv":
            self.send_error(404)
            return
        wanted = self.headers["Range"] if self.resumable else None
        start = int(wanted.removeprefix("bytes=").removesuffix("-")) if wanted else 0
        self.asked.append(self.headers["Range"])
        if start >= len(self.content):
            self.send_error(416)
            return
        self.send_response(206 if wanted else 200)
        self.send_header("Content-Length", str(len(self.content) - start))
        self.end_headers()
        stop = self.cut if self.cut and len(self.asked) == 1 else len(self.content)
        self.wfile.write(self.content[start:stop])

    def log_message(self, *_):
        pass


@pytest.fixture
def serve():
    """Start servers on the loopback address; returns the file's URL and the ranges asked for."""
    servers = []

    def start(content, resumable=True, cut=0):
        asked = []
        handler = functools.partial(Server, content, resumable, cut, asked)
        server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        servers.append((server, thread))
        return f"http://127.0.0.1:{server.server_port}/rows.csv", asked

    yield start
    for server, thread in servers:
        server.shutdown()
        thread.join()
        server.server_close()


@pytest.fixture
def content(tmp_path):
    return write_csv(tmp_path / "made.csv", car(1, range(50))).read_bytes()


def test_download_with_progress(serve, content, tmp_path):
    url, asked = serve(content)
    seen = []
    path = download(tmp_path / "out", url, lambda done, total: seen.append((done, total)))
    assert path == tmp_path / "out" / "rows.csv"
    assert path.read_bytes() == content
    assert seen[-1] == (len(content), len(content))
    download(tmp_path / "out", url)
    assert len(asked) == 1
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("resumable", [True, False])
def test_a_broken_download_goes_on(serve, content, tmp_path, resumable):
    url, asked = serve(content, resumable, cut=500)
    with pytest.raises(UserError, match="the connection broke: run the command again"):
        download(tmp_path, url)
    assert (tmp_path / "rows.csv.part").stat().st_size == 500
    assert download(tmp_path, url).read_bytes() == content
    assert asked == [None, "bytes=500-"]


def test_a_finished_part_is_only_renamed(serve, content, tmp_path):
    (tmp_path / "rows.csv.part").write_bytes(content)
    url, _ = serve(content)
    assert download(tmp_path, url).read_bytes() == content


def test_what_is_not_data_is_not_kept(serve, tmp_path):
    url, _ = serve(b"<html>please log in</html>\n")
    with pytest.raises(UserError, match="not trajectory data"):
        download(tmp_path, url)
    assert not any(tmp_path.iterdir())


def test_errors_name_the_address(serve, content, tmp_path):
    url, _ = serve(content)
    with pytest.raises(UserError, match="nothing: the server answers 404"):
        download(tmp_path, url.replace("rows.csv", "nothing"))
    with pytest.raises(UserError, match="cannot be reached"):
        download(tmp_path, "http://127.0.0.1:9/rows.csv")
    with pytest.raises(UserError, match="not an http"):
        download(tmp_path, "rows.csv")
