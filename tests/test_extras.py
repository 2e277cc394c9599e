"""The core does without the extras; where one is missing, the message says what to type."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

import pinbound
from pinbound.cli import app
from pinbound.exceptions import UnsupportedError
from pinbound.extras import EXTRAS, Needs, require

if sys.version_info >= (3, 11):
    import tomllib
else:
    tomllib = pytest.importorskip("tomli")

HERE = Path(__file__).resolve().parents[1]
PROJECT: dict[str, Any] = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OPTIONAL = (
    "matplotlib",
    "sympy",
    "mpmath",
    "jinja2",
    "trimesh",
    "networkx",
    "collada",
    "yourdfpy",
    "numba",
    "llvmlite",
)
OPTIONAL += ("pyarrow", "pandas", "dask", "distributed", "casadi", "pink", "mink", "qpsolvers", "mkdocs", "pytest")

CORE = f"""
import sys
for name in {OPTIONAL!r}:
    sys.modules[name] = None                      # importing it fails, as if it were not installed
import warnings
warnings.simplefilter("ignore")
import numpy as np
import pinbound as pb
from typer.testing import CliRunner
from pinbound.cli import app

robot = pb.load("minervabot_v3")
waypoints = [robot.home, [0.0, 0.5, 0.5]]
assert robot.boundaries.free(robot.home)
assert robot.boundaries.signed_clearances(np.zeros((5, 3))).shape == (5, 10)
assert pb.certify(robot, waypoints).verdict is pb.Verdict.CERTIFIED
assert pb.certify_box(robot, [-1.0, 0.1, 0.0], [1.0, 0.6, 0.3]).verdict is pb.Verdict.CERTIFIED
region = pb.feasible_region(robot, ("q2", "q3"))
assert len(region.edges) == 6
assert pb.plan(robot, *waypoints).verdict is pb.Verdict.CERTIFIED
assert pb.StepBounds(robot).rows(robot.home, 0.2).names
section = pb.workspace_section(robot, region, "link_6", turn="q1")


def said(call):
    try:
        call()
    except pb.UnsupportedError as error:
        return str(error)
    return "nothing"


def figure():
    assert "<svg" not in pb.feasible_region(robot, ("q2", "q3"))._repr_html_()
    robot.plot()


print("plots:", said(figure))
print("symbols:", said(robot.boundaries["beta_1"].expression))
print("symbols:", said(robot.boundaries["beta_1"].latex))
print("meshes:", said(pb.swept_body(robot, section).mesh))
print("fast:", said(lambda: robot.boundaries.norms(np.zeros((2, 3)), backend="compiled")))
print("bridges:", said(robot.boundaries.to_casadi))
open("motion.csv", "w").write("q1,q2,q3\\n0,0,0\\n0,20,30\\n")
for words in ("info minervabot_v3", "limits minervabot_v3", "region minervabot_v3", "robots",
              "check minervabot_v3 motion.csv --deg", "export minervabot_v3 c --out a.c"):
    result = CliRunner().invoke(app, words.split())
    assert result.exit_code in (0, 1) and not isinstance(result.exception, ImportError), (words, result.output)
for extra, words in (("symbols", "derive minervabot_v3"), ("report", "report minervabot_v3 --out here"),
                     ("report", "reproduce --out there"), ("report", "explore minervabot_v3 --out p.html"),
                     ("batch", "batch minervabot_v3 --random 5 --out rows"),
                     ("plots", "check minervabot_v3 motion.csv --deg --plot a.png")):
    result = CliRunner().invoke(app, words.split())
    assert result.exit_code == 2, (words, result.output)
    print(f"{{extra}}:", " ".join(result.output.split()))
"""


def test_the_core_works_without_extras_and_names_what_is_missing(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", CORE], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 12
    for line in lines:
        extra = line.partition(":")[0]
        assert f"pip install 'pinbound[{extra}]'" in line


def names(requirements: list[str]) -> set[str]:
    return {re.split(r"[\[<>=;]", one)[0] for one in requirements}


def test_extras_are_those_of_the_package() -> None:
    optional: dict[str, list[str]] = PROJECT["optional-dependencies"]
    packages = {"collada": "pycollada"}
    for extra, modules in EXTRAS.items():
        brought = names(optional[extra])
        for one in optional[extra]:
            for inner in re.findall(r"pinbound\[(.*)\]", one):
                brought |= names([name for part in inner.split(",") for name in optional[part]])
        assert {packages.get(module, module) for module in modules} <= brought, extra
    assert not set(OPTIONAL) & names(PROJECT["dependencies"])
    everything = re.findall(r"pinbound\[(.*)\]", optional["all"][0])[0].split(",")
    assert set(everything) == {*EXTRAS, "fast", "batch"}


def bounds(requirements: list[str]) -> dict[str, str]:
    """Return the lower bound of each requirement by its name, ">=1.2" or "" without one."""
    found = (re.match(r"([\w.-]+)(?:\[.*?\])?\s*(>=[\d.]+)?", one) for one in requirements)
    return {one[1]: one[2] or "" for one in found if one}


def test_the_recipe_for_conda_needs_what_the_core_needs() -> None:
    """The recipe is not built here: what it says is compared, with the names that conda has for the same."""
    other = {"pin": "pinocchio", "matplotlib": "matplotlib-base"}
    recipe = yaml.safe_load((HERE / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    needs = recipe["requirements"]
    core = {other.get(name, name): bound for name, bound in bounds(PROJECT["dependencies"]).items()}
    python = {"python": PROJECT["requires-python"]}
    assert bounds(needs["run"]) == core | python
    optional = {
        other.get(name, name): bound
        for extra in ("plots", "symbols", "report", "fast", "batch", "meshes")
        for name, bound in bounds(PROJECT["optional-dependencies"][extra]).items()
    }
    constraints = bounds(needs["run_constraints"])
    assert constraints.items() <= optional.items()
    assert {"matplotlib-base", "sympy", "jinja2", "numba", "pyarrow", "trimesh"} <= set(constraints)
    build: list[str] = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    assert bounds(needs["host"]) == bounds(build) | python | {"pip": ""}
    assert recipe["context"]["version"] == pinbound.__version__
    assert recipe["build"]["noarch"] == "python"
    assert recipe["about"]["license"] == PROJECT["license"]
    assert (HERE / recipe["about"]["license_file"]).exists()
    assert recipe["about"]["summary"] == PROJECT["description"]
    commands = {command.name or command.callback.__name__ for command in app.registered_commands if command.callback}
    scripts = [line.split() for one in recipe["tests"] for line in one.get("script", ())]
    assert [words[1] for words in scripts if words[1] not in commands] == ["--version"]


def test_the_file_for_hosted_machines_says_what_the_project_says() -> None:
    """Its Pythons are those that are promised, one more is tried; its commands are those of `.ci/run`."""
    jobs = yaml.safe_load((HERE / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))["jobs"]
    promised = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    matrix = jobs["test"]["strategy"]["matrix"]["python"]
    assert matrix[: len(promised)] == promised
    for tried in matrix[len(promised) :]:
        assert f"matrix.python == '{tried}'" in jobs["test"]["continue-on-error"]
    lowest = PROJECT["requires-python"].removeprefix(">=")
    assert promised[0] == lowest
    said = (HERE / "docs" / "install.md").read_text(encoding="utf-8")
    assert f"Python {promised[0]} to {promised[-1]}" in said
    asked = {job: [step.get("run", "") for step in one["steps"]] for job, one in jobs.items()}
    versions = "\n".join(asked["lowest"])
    assert f".ci/versions python{lowest} lowest" in versions
    assert any(one.get("with", {}).get("python-version") == lowest for one in jobs["lowest"]["steps"])
    own = (HERE / ".ci" / "run").read_text(encoding="utf-8")
    checks = [part.strip() for line in asked["checks"] for part in line.split("&&") if part.strip()]
    for command in checks:
        plain = command.replace("mkdocs build --strict", "mkdocs build --quiet --strict")
        assert plain.replace("pip install", "pip install --quiet") in own or plain in own, command
    for extra in re.findall(r"\[([\w,]+)\]", "\n".join(line for lines in asked.values() for line in lines)):
        assert set(extra.split(",")) <= set(PROJECT["optional-dependencies"]), extra


def test_one_place_has_the_version() -> None:
    assert PROJECT["dynamic"] == ["version"]
    assert f"version: {pinbound.__version__}\n" in (HERE / "CITATION.cff").read_text(encoding="utf-8")


def test_other_errors_pass() -> None:
    with pytest.raises(ModuleNotFoundError, match="numpy_of_nobody"), Needs("plots", "a figure"):
        raise ModuleNotFoundError("No module named 'numpy_of_nobody'", name="numpy_of_nobody")
    with pytest.raises(ValueError, match="other"), Needs("plots", "a figure"):
        raise ValueError("other")


def test_require_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    require("report", "a report")
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.raises(UnsupportedError, match=r"a report needs jinja2.*'pinbound\[report\]'"):
        require("report", "a report")
