"""uqpen's server of models, in the process of the tests or as the command, and a client of it."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import ProxyHandler, Request, build_opener

from uqpen.server import ModelServer, RunBudget, ServedModel

# Has the documented server listen on a free port, and for this machine alone.
LISTENING = """\
import socket
from aiohttp import web
listening, run_app = socket.create_server(("127.0.0.1", 0)), web.run_app
print(listening.getsockname()[1], flush=True)
web.run_app = lambda app, port: run_app(app, sock=listening, print=None)
"""


@contextlib.contextmanager
def offering(*offers: ServedModel, budget: RunBudget | None = None) -> Iterator[str]:
    """The address of a server with these offers, in a thread."""
    with ModelServer(offers, port=0, budget=budget) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server.url
        finally:
            server.shutdown()
            thread.join()


@contextlib.contextmanager
def serving(folder: Path, *arguments: str) -> Iterator[tuple[str, str, subprocess.Popen[str]]]:
    """What `uqpen serve` prints, the address that it tells, and its process."""
    command = [sys.executable, "-m", "uqpen", "serve", "--port", "0", *arguments]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder
    ) as process:
        assert process.stdout is not None
        try:
            lines: list[str] = []
            while not lines or not lines[-1].startswith("listening"):
                lines.append(process.stdout.readline())
                assert lines[-1], process.communicate()
            found = re.search(r"listening at (\S+) ", lines[-1])
            assert found
            yield "".join(lines), found[1], process
        finally:
            process.kill()


def asked(address: str, path: str, content: bytes | None, **headers: str) -> tuple[int, Any]:
    """Code and content of an answer, which no proxy gives."""
    headers = {"Content-Type": "application/json"} | {
        name.replace("_", "-"): value for name, value in headers.items()
    }
    request = Request(f"{address}/{path}", content, headers)
    try:
        with build_opener(ProxyHandler({})).open(request, timeout=60) as response:
            return response.status, json.load(response)
    except HTTPError as error:
        with error:
            return error.code, json.load(error)
