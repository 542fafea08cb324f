"""A UM-Bridge server made with the package of that name, for tests to run as a program."""

from __future__ import annotations

import math
import os
import socket
import sys
import time
from typing import Any

import umbridge
from aiohttp import web


class Sum(umbridge.Model):
    """y = 100 (a + b) + c and z = a, of two vectors, or what the config says in their place."""

    def get_input_sizes(self, config: Any) -> list[int]:
        return [2, 1]

    def get_output_sizes(self, config: Any) -> list[int]:
        return [1, 1]

    def supports_evaluate(self) -> bool:
        return True

    def __call__(self, parameters: Any, config: Any) -> Any:
        (a, b), (c,) = parameters
        if a > config.get("limit", math.inf):
            what = config["beyond"]
            if what == "die":
                os._exit(1)
            if what == "raise":
                raise ArithmeticError("the server keeps this to itself")
            if what == "sleep":
                time.sleep(2.0)
            return {"nan": [[math.nan], [a]], "inf": [[b], [-math.inf]], "short": [[b]]}[what]
        return [[config.get("factor", 100.0) * (a + b) + c], [a]]


class Idle(Sum):
    """A model that cannot be run."""

    def supports_evaluate(self) -> bool:
        return False


def main() -> None:
    """Serve until killed; the first line that is printed is the port."""
    # The package would listen on every network.
    listening = socket.create_server(("127.0.0.1", 0))
    sys.stdout.write(f"{listening.getsockname()[1]}\n")
    sys.stdout.flush()
    run_app = web.run_app
    web.run_app = lambda app, port: run_app(app, sock=listening, print=None)
    umbridge.serve_models([Sum("sum"), Idle("idle")][: int(sys.argv[1])], max_workers=2)


if __name__ == "__main__":
    main()
