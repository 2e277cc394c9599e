"""The explorer's pages in a real browser: opened, with every fault and every request to the network kept."""

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",  # WebGL by the processor, to compare with
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


def launched() -> Iterator[Any]:
    """Yield a browser; skip where there is none."""
    programs = [shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome")]
    program = next((one for one in programs if one), None)
    if program is None:
        pytest.skip("no Chromium is installed: apt-get install chromium")
    playwright = pytest.importorskip("playwright.sync_api", reason="no Playwright is installed: pip install playwright")
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=program, headless=True, args=FLAGS)
        yield found
        found.close()


def until(page: Any, condition: str, seconds: float = 30.0) -> None:
    """Ask until it holds: Playwright's own waiting makes code from text, which the page's security policy forbids."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, condition
        page.wait_for_timeout(20)


def opened(browser: Any, path: Path, scripts: str = "", **options: Any) -> Any:
    page = browser.new_page(**{"viewport": {"width": 1280, "height": 900}} | options)
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.on("console", lambda said: page.faults.append(said.text) if said.type == "error" else None)
    page.on("request", lambda asked: asked.url.startswith(("file:", "data:")) or page.faults.append(asked.url))
    if scripts:
        page.add_init_script(scripts)
    page.goto(path.as_uri())
    until(page, "() => window.pinbound?.panels && pinbound.frames > 0")
    return page
