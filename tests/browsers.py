"""A browser that shows pages to tests."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

FLAGS = [
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

# No chart of a report is drawn, which takes most of the time of a page. Charts have their room all
# the same.
IDLE = "window.requestIdleCallback = () => 0; IntersectionObserver.prototype.observe = () => {};"


@contextlib.contextmanager
def chromium() -> Iterator[Browser]:
    """A browser without a window, in a loop of events; where there is none, the test is skipped."""
    found = map(shutil.which, ("chromium", "google-chrome", "chromium-browser"))
    path = next(filter(None, found), None)
    if path is None:
        pytest.skip("no Chromium is installed (Debian: apt-get install chromium)")
    flags = [*FLAGS, "--no-sandbox"] if os.geteuid() == 0 else FLAGS
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=path, args=flags)
        yield started
        started.close()


def wait_for_charts(page: Page, theme: str = "light") -> None:
    """Until all charts of a report that are not folded are drawn in a theme."""
    missing = f".plot:not([data-drawn={theme}], details:not([open]) *)"
    page.wait_for_selector(f"html[data-ready=yes]:not(:has({missing}))", state="attached")


def settle(page: Page) -> None:
    """Wait until the charts have followed what was moved last."""
    page.evaluate("() => new Promise((done) => setTimeout(() => requestAnimationFrame(done), 20))")
    page.evaluate("() => new Promise((done) => requestAnimationFrame(done))")
