"""Whether the explorer's page has Python's numbers: signed clearances and places of links in random poses, in Chromium.

    python benchmarks/explorer_poses.py minervabot_v3 link5-link7 arm.urdf+arm.yaml

`link5-link7` is the Panda of `benchmarks/link5_link7.py`; a robot's annotations follow its file after `+`. Poses are
drawn evenly between the limits of the joints (of a joint without limits: in one turn). Needs Chromium and Playwright.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

import pinbound as pb

ASK = """(Q) => JSON.stringify({
  clearances: Q.map((q) => [...pinbound.robot.evaluate(q)]), places: Q.map((q) => pinbound.robot.places(q)),
})"""


def robot_named(name: str) -> pb.Robot:
    """Load a robot, the Panda's case among them."""
    if name == "link5-link7":
        sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
        from benchmarks.link5_link7 import robot_of

        return robot_of(1.87)
    source, _, annotations = name.partition("+")
    return pb.load(source, annotations or None)


def main() -> int:
    """Compare and print; the exit code is 1 if a number differs by more than 1e-12."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="+")
    parser.add_argument("--poses", type=int, default=1000)
    options = parser.parse_args()
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    worst = 0.0
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        for name in options.robots:
            robot = robot_named(name)
            path = pb.explorer_page(robot, planes=[]).save(Path(folder) / "page.html")
            low, high = np.clip(robot.lower, -np.pi, np.pi), np.clip(robot.upper, -np.pi, np.pi)
            Q = np.random.default_rng(0).uniform(low, high, (options.poses, len(low)))
            page = browser.new_page()
            page.goto(path.as_uri())
            page.wait_for_timeout(500)
            found = json.loads(page.evaluate(ASK, Q.tolist()))
            page.close()
            off = np.abs(np.array(found["clearances"]) - robot.boundaries.signed_clearances(Q)).max()
            places = np.array(found["places"]).reshape(len(Q), -1, 4, 4)[:, :, 3, :3]
            origins = np.stack([robot.positions(link, Q) for link in robot.tree.links], axis=1)
            apart = np.abs(places - origins).max()
            worst = max(worst, off, apart)
            count = f"{len(Q)} poses, {len(robot.boundaries)} boundaries"
            print(f"{robot.name}: {count}: clearances {off:.1e} m, places {apart:.1e} m")
        browser.close()
    return int(worst > 1e-12)


if __name__ == "__main__":
    sys.exit(main())
