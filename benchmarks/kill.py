"""Kill a batch job with SIGKILL at random moments, resume it each time, and compare it with an undisturbed one.

python -m benchmarks.kill --kills 20
"""

from __future__ import annotations

import argparse
import hashlib
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

CODE = "import sys; from pinbound.cli import main; main()"


def digests(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("part-*.parquet")}


def main() -> None:
    """Run the campaign; exit 1 if a single byte differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--rows", type=int, default=6_000_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    words = ["batch", "minervabot_v3", "--random", str(options.rows), "--chunk-rows", "20000"]
    words += ["--columns", "coordinates,clearances,smallest,verdict"]
    random = np.random.default_rng(options.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def start(where: str) -> subprocess.Popen[bytes]:
            command = [sys.executable, "-c", CODE, *words, "--out", str(folder / where)]
            return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        kills, runs = 0, 0
        while kills < options.kills and runs < 4 * options.kills:
            process, runs = start("killed"), runs + 1
            try:
                process.wait(timeout=float(random.uniform(1.0, 4.0)))
                break
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.wait()
                kills += 1
            print(f"kill {kills}: {len(list((folder / 'killed').glob('part-*.json')))} chunks are done", flush=True)
        if start("killed").wait() or start("whole").wait():
            sys.exit("a run failed")
        same = digests(folder / "killed") == digests(folder / "whole")
        chunks = len(digests(folder / "whole"))
        print(f"{kills} kills; all {chunks} chunks equal those of an undisturbed job: {same}")
        sys.exit(0 if same and kills else 1)


if __name__ == "__main__":
    main()
