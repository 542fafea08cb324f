"""``python -m uqpen``."""

from __future__ import annotations

from uqpen.cli.main import main

main()
