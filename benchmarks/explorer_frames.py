"""How fast the explorer's page answers while one drags: frames a second, and milliseconds of script a frame.

    python benchmarks/explorer_frames.py PAGE.html [PAGE.html ...]

Needs Chromium and Playwright (extra `test`). The window is 1280 x 900; headless Chromium draws WebGL by the processor.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
DRAG = """() => new Promise((done) => {
  const { plane } = pinbound, start = performance.now(), [frames, spent] = [pinbound.frames, pinbound.spent];
  const box = plane.element.getBoundingClientRect();
  let [k, longest, last] = [0, 0, start];
  const tick = (now) => {
    longest = Math.max(longest, now - last);
    last = now;
    const t = k++ / 40;
    plane.to([box.width * (0.5 + 0.2 * Math.cos(t)), box.height * (0.5 + 0.2 * Math.sin(t))]);
    if (now - start < 4000) return requestAnimationFrame(tick);
    const count = pinbound.frames - frames;
    done([count / (now - start) * 1000, (pinbound.spent - spent) / count, longest]);
  };
  requestAnimationFrame(tick);
})"""


def main() -> int:
    """Measure and print."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="+", type=Path)
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=FLAGS)
        for path in parser.parse_args().pages:
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.goto(path.resolve().as_uri())
            page.wait_for_timeout(1500)
            rate, script, longest = page.evaluate(DRAG)
            print(f"{path.name}: {rate:.1f} frames/s, {script:.2f} ms of script a frame, longest gap {longest:.0f} ms")
            page.close()
        browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
