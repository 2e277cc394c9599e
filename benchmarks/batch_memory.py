"""Run `pinbound batch` on a large Parquet file and print its peak memory: it must not follow the file.

python -m benchmarks.batch_memory --rows 100000000 --most 600

The file (three columns float32, row groups of a million rows, or `--group`) and the results go to a temporary folder
(`--folder` for another place), which is removed: 1.2 GB and about 3 GB at 10^8 rows. Exit 1 if the peak is above
`--most` MB, or if the totals are not those of the source.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

LOWER, UPPER = np.array([-1.0, -2.0, -2.0]), np.array([1.0, 2.0, 2.0])


def make(path: Path, rows: int, group: int) -> None:
    """Write uniform points of a box, a row group at a time."""
    random = np.random.default_rng(0)
    schema = pa.schema([(name, pa.float32()) for name in ("q1", "q2", "q3")])
    with pq.ParquetWriter(path, schema, compression="none", use_dictionary=False) as writer:
        for start in range(0, rows, group):
            points = random.random((min(group, rows - start), 3), dtype=np.float32) * (UPPER - LOWER) + LOWER
            columns = [pa.array(column.astype(np.float32)) for column in points.T]
            writer.write_table(pa.table(columns, schema=schema), row_group_size=group)


def main() -> None:
    """Print one line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--group", type=int, default=1_000_000)
    parser.add_argument("--most", type=float, default=600.0, help="MB")
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        path, out = Path(name) / "q.parquet", Path(name) / "out"
        make(path, options.rows, options.group)
        command = [sys.executable, "-m", "pinbound", "batch", "minervabot_v3", "--in", str(path), "--out", str(out)]
        begun = time.perf_counter()
        with subprocess.Popen([*command, "--json"], stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            said = child.stdout.read()
            _, status, used = os.wait4(child.pid, 0)  # the peak of this child alone
            child.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.perf_counter() - begun
        peak = used.ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
        total = json.loads(said)["rows"] if child.returncode == 0 else None
        size = path.stat().st_size
    print(
        f"{options.rows:,} rows in groups of {options.group:,} ({size / 1e9:.2f} GB): exit code {child.returncode}, "
        f"{total} rows counted, peak {peak:.0f} MB, {seconds:.0f} s, {used.ru_utime + used.ru_stime:.0f} s of CPU time"
    )
    sys.exit(0 if total == options.rows and peak <= options.most else 1)


if __name__ == "__main__":
    main()
