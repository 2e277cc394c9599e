"""Fixtures: the packaged robot, and small robots written out as URDF."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

import pinbound as pb
import robots

os.environ.setdefault("PINBOUND_XACRO_SECONDS", "60")  # machines under test may be slow; that is no fault of xacro's


@pytest.fixture(scope="session")
def minerva() -> pb.Robot:
    return pb.load("minervabot_v3")


@pytest.fixture(scope="session")
def as_printed() -> pb.Robot:
    return pb.load("minervabot_v3", xacro_args={"bridge": "as_printed"})


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
