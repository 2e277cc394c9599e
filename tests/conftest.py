"""Fixtures: the packaged robot, and small robots written out as URDF."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import pages
import pinbound as pb
import robots
import tiers

os.environ.setdefault("PINBOUND_XACRO_SECONDS", "60")  # machines under test may be slow; that is no fault of xacro's


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Read no file of which the quick tier runs nothing: reading all of them takes longer than a third of its tests."""
    files = {name.partition("::")[0] for names in tiers.QUICK.values() for name in names}
    is_test = collection_path.name.startswith("test_") and collection_path.suffix == ".py"
    return True if config.option.markexpr == "not slow" and is_test and collection_path.stem not in files else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as slow what the quick tier (`tiers.py`) does not list."""
    for item in items:
        if not tiers.is_quick(item.path.stem, item.name.partition("[")[0]):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def minerva() -> pb.Robot:
    return pb.load("minervabot_v3")


@pytest.fixture(scope="session")
def as_printed() -> pb.Robot:
    return pb.load("minervabot_v3", xacro_args={"bridge": "as_printed"})


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless Chromium, started once a file; tests are skipped, with the reason, where there is none."""
    yield from pages.launched()


@pytest.fixture
def load_text(tmp_path: Path) -> Callable[..., pb.Robot]:
    """Load a robot from the text of a URDF, and of a sidecar."""

    def load(urdf: str, sidecar: str | None = None) -> pb.Robot:
        path = tmp_path / "robot.urdf"
        path.write_text(urdf)
        if sidecar is not None:
            (tmp_path / "robot.pinbound.yaml").write_text(sidecar)
        return pb.load(path)

    return load


@pytest.fixture(scope="session", params=sorted(robots.ZOO))
def any_robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> pb.Robot:
    """Each robot of the zoo in turn."""
    source = robots.ZOO[request.param]
    if source in pb.packaged_robots():
        return pb.load(source)
    path = tmp_path_factory.mktemp("zoo") / f"{request.param}.urdf"
    path.write_text(source)
    return pb.load(path)
