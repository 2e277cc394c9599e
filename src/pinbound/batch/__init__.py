"""Millions to billions of configurations, from files, grids or random points to Parquet; resumable, also on a cluster.

evaluation = evaluation_of(robot, columns=("smallest", "verdict"))
outcome = run(evaluation, RandomSource(10**8, seed=1, lower=..., upper=...), Path("out"))
"""

from pinbound.batch.evaluation import COLUMNS, VERDICTS, Evaluation, Statistics, evaluation_of
from pinbound.batch.job import Outcome, run
from pinbound.batch.sources import FileSource, GridSource, RandomSource, SobolSource, Source, open_source

__all__ = [
    "COLUMNS",
    "VERDICTS",
    "Evaluation",
    "FileSource",
    "GridSource",
    "Outcome",
    "RandomSource",
    "SobolSource",
    "Source",
    "Statistics",
    "evaluation_of",
    "open_source",
    "run",
]
