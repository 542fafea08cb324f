"""A notebook in a real kernel, whose cells are executed one after the other."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jupyter_client import BlockingKernelClient, KernelManager
from jupyter_client.manager import start_new_kernel

# Long enough for a machine that is busy with other work; nothing waits for it to pass.
PATIENCE = 300


class Notebook:
    """A notebook whose cells are executed one after the other."""

    def __init__(self, manager: KernelManager, client: BlockingKernelClient) -> None:
        self.manager, self.client = manager, client

    def run(self, code: str) -> list[dict[str, Any]]:
        """Execute a cell; return what it shows."""
        reply, outputs = self.finish(self.start(code))
        assert reply["status"] == "ok", "\n".join(reply["traceback"])
        return outputs

    def start(self, code: str) -> str:
        return str(self.client.execute(textwrap.dedent(code)))

    def finish(self, message: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        outputs = []
        while True:
            reported = self.client.get_iopub_msg(timeout=PATIENCE)
            if reported["parent_header"].get("msg_id") != message:
                continue
            if (
                reported["msg_type"] == "status"
                and reported["content"]["execution_state"] == "idle"
            ):
                break
            outputs.append(reported["content"])
        while True:  # replies to questions of before, whether it is ready, may come as well
            reply = self.client.get_shell_msg(timeout=PATIENCE)
            if reply["parent_header"].get("msg_id") == message:
                return reply["content"], outputs


@contextmanager
def open_notebook(folder: Path) -> Iterator[Notebook]:
    """Start a kernel in a folder."""
    manager, client = start_new_kernel(cwd=str(folder), startup_timeout=PATIENCE)
    try:
        yield Notebook(manager, client)
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def shown(outputs: list[dict[str, Any]]) -> str:
    return "\n".join(
        str(output["data"].get("text/html", "")) for output in outputs if "data" in output
    )
