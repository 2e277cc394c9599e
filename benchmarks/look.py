"""Photograph pages, to be looked at: the whole site, or files, at 1280 and 390 pixels, in light or dark mode.

    mkdocs build --strict --site-dir site && python benchmarks/look.py site --out shots
    python benchmarks/look.py report/index.html explorer.html --out shots --dark

Needs Chromium and Playwright (extra `test`). A page is cut into pictures of 1,600 pixels, so that letters can be read.
It prints pages that are wider than the screen, and text that looks like Markdown or LaTeX that was not translated; a
person has to see the rest.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from pathlib import Path
from typing import Any

FLAGS = ["--no-sandbox", "--disable-gpu", "--allow-file-access-from-files"]
HEIGHT = 1600
RAW = re.compile(r"```|\*\*|\]\(|\\(?:frac|mathrm|cos|sin)\b|(?m:^\|)|(?m:^ *[-*] )|:::|\b[\w-]+\.md\b")
TEXT = """() => { const copy = (document.querySelector("article") ?? document.body).cloneNode(true);
  copy.querySelectorAll("pre, script, style, math, code, svg").forEach((one) => one.remove());
  return copy.textContent; }"""


def look(page: Any, path: Path, name: str, out: Path) -> None:
    """Write the pictures of one page, and print what can be found without eyes."""
    page.goto(path.resolve().as_uri())
    page.evaluate("() => document.querySelectorAll('img').forEach((one) => { one.loading = 'eager'; })")
    page.wait_for_timeout(600)
    width, height = page.evaluate("() => [document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
    screen = page.viewport_size["width"]
    if width > screen:
        print(f"{name}: {width} pixels wide on a screen of {screen}")
    for found in RAW.finditer(page.evaluate(TEXT)):
        print(f"{name}: raw text {found[0]!r}")
    for part, top in enumerate(range(0, height, HEIGHT)):
        clip = {"x": 0, "y": top, "width": screen, "height": min(HEIGHT, height - top)}
        page.screenshot(path=str(out / f"{name}-{screen}-{part}.png"), full_page=True, clip=clip)


def main() -> int:
    """Look at all pages."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="+", type=Path, help="pages, or folders of a site")
    parser.add_argument("--out", type=Path, default=Path("shots"))
    parser.add_argument("--dark", action="store_true")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    found = [
        (page, one) for page in options.pages for one in (sorted(page.rglob("*.html")) if page.is_dir() else [page])
    ]
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=FLAGS)
        for width in (1280, 390):
            scheme = "dark" if options.dark else "light"
            page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
            for root, one in found:
                name = "-".join((one.relative_to(root) if root.is_dir() else one).with_suffix("").parts).strip("-/")
                look(page, one, re.sub(r"[^\w-]", "", name), options.out)
            page.close()
        browser.close()
    print(f"{len(found)} pages are in {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
