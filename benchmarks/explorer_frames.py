"""How fast the explorer's page answers while one drags: frames a second, and processor milliseconds a frame.

    python benchmarks/explorer_frames.py PAGE.html [PAGE.html ...]

Needs Chromium and Playwright (extra `test`). The window is 1280 x 900. Headless Chromium has no graphics processor, so
the page draws the robot by its own `pen_soft.js`; `--webgl` makes it use WebGL all the same, which Chromium then
computes on the processor. `--full` keeps the page from drawing fewer pixels, so that runs compare on a busy machine.
Milliseconds are those of the page's main thread on the processor, so that other programs on
the machine do not count: script alone, and all of it (script, style, layout, painting). Frames a second are on the
clock.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path
from typing import Any

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
DRAG = """() => new Promise((done) => {
  const { plane } = pinbound, start = performance.now(), frames = pinbound.frames;
  const box = plane.element.getBoundingClientRect();
  let [k, longest, last] = [0, 0, start];
  const tick = (now) => {
    longest = Math.max(longest, now - last);
    last = now;
    const t = k++ / 40;
    plane.to([box.width * (0.5 + 0.2 * Math.cos(t)), box.height * (0.5 + 0.2 * Math.sin(t))]);
    if (now - start < 4000) return requestAnimationFrame(tick);
    const count = pinbound.frames - frames;
    done([count, count / (now - start) * 1000, longest, pinbound.scene.step]);
  };
  requestAnimationFrame(tick);
})"""
UNNAMED = """
const old = WebGL2RenderingContext.prototype.getExtension;
WebGL2RenderingContext.prototype.getExtension = function (name) {
  return name === "WEBGL_debug_renderer_info" ? null : old.call(this, name);
};"""


def _spent(metrics: Any) -> tuple[float, float]:
    """Return seconds of the main thread: script, and all tasks."""
    found = {one["name"]: one["value"] for one in metrics.send("Performance.getMetrics")["metrics"]}
    return found["ScriptDuration"], found["TaskDuration"]


def main() -> int:
    """Measure and print."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="+", type=Path)
    parser.add_argument("--full", action="store_true", help="keep the full resolution, however late frames come")
    parser.add_argument("--webgl", action="store_true", help="let the page believe that its WebGL is fast")
    options = parser.parse_args()
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=FLAGS)
        for path in options.pages:
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            if options.webgl:
                page.add_init_script(UNNAMED)
            page.goto(path.resolve().as_uri())
            page.wait_for_timeout(1500)
            if options.full:
                page.evaluate("() => { pinbound.scene.pace = () => {}; }")
            metrics = page.context.new_cdp_session(page)
            metrics.send("Performance.enable", {"timeDomain": "threadTicks"})
            before = _spent(metrics)
            count, rate, longest, step = page.evaluate(DRAG)
            script, all_of_it = (1e3 * (b - a) / count for a, b in zip(before, _spent(metrics), strict=True))
            print(
                f"{path.name}: {rate:.1f} frames/s, longest gap {longest:.0f} ms; a frame takes {all_of_it:.2f} ms of "
                f"the processor, {script:.2f} ms of it script; resolution step {step}"
            )
            page.close()
        browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
