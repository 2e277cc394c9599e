"""A batch as Parquet, resumed by the same command, read back with pandas: `python examples/08_parquet.py`.

Needs pyarrow (extra `batch`) and pandas (extra `test`). Prints:
    40000 rows in 4 files, columns row, q1, q2, q3, smallest_clearance, smallest_boundary, verdict
    contact 38435, inside 1565
    inside, the nearest boundary is most often beta_3
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import pandas as pd

with tempfile.TemporaryDirectory() as name:
    folder = Path(name) / "batch"
    words = ["batch", "minervabot_v3", "--sobol", "40000", "--chunk-rows", "10000", "--out", str(folder)]
    subprocess.run([sys.executable, "-m", "pinbound", *words], check=True, capture_output=True)
    files = sorted(folder.glob("part-*.parquet"))
    table = pd.concat([pd.read_parquet(file) for file in files])
# DuckDB reads them by "select * from '.../part-*.parquet'"
print(f"{len(table)} rows in {len(files)} files, columns {', '.join(table.columns)}")
counts = table["verdict"].astype(str).value_counts().sort_index()
print(", ".join(f"{verdict} {count}" for verdict, count in counts.items()))
nearest = table.loc[table["verdict"] == "inside", "smallest_boundary"].value_counts().idxmax()
print(f"inside, the nearest boundary is most often {nearest}")
