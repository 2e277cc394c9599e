"""Grow polytopes by Drake's IrisZo, default options, around given seeds: the peer of `free_spaces.py polytope`.

    python benchmarks/iris_zo.py panda_spherized.urdf --pairs pairs.json --seeds seeds.json --out iris.json

Needs Drake, and nothing of pinbound. The spheres of the URDF collide where the pairs say, body by body. `free_spaces.py
polytope ... --iris iris.json` judges them with the same samples as pinbound's polytopes.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np


def checker_of(urdf: Path, pairs: Path) -> Any:
    """Return Drake's collision checker of the robot, with collisions between the pairs' links alone."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.tree import BodyIndex
    from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

    root = ET.parse(urdf).getroot()
    for link in root.iter("link"):  # files that are not there, and have no part in this
        for visual in link.findall("visual"):
            link.remove(visual)
    links = [
        link.get("name")
        for link in root.iter("link")
        for body in link.iter("collision")
        if body.find("geometry/sphere") is not None
    ]
    wanted = {frozenset((links[a], links[b])) for a, b in json.loads(pairs.read_text())}
    builder = RobotDiagramBuilder(time_step=0.0)
    plant = builder.plant()
    (model,) = Parser(plant).AddModelsFromString(ET.tostring(root, encoding="unicode"), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.get_body(plant.GetBodyIndices(model)[0]).body_frame())
    plant.Finalize()
    checker = SceneGraphCollisionChecker(model=builder.Build(), robot_model_instances=[model], edge_step_size=0.1)
    bodies = [plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())]
    for a, b in itertools.combinations(bodies, 2):
        if plant.world_body() in (a, b) or checker.IsCollisionFilteredBetween(a, b):
            if frozenset((a.name(), b.name())) in wanted:
                checker.SetCollisionFilteredBetween(a, b, False)
            continue
        checker.SetCollisionFilteredBetween(a, b, frozenset((a.name(), b.name())) not in wanted)
    return checker


def main() -> int:
    """Grow and write."""
    from pydrake.common import Parallelism
    from pydrake.geometry.optimization import HPolyhedron, Hyperellipsoid
    from pydrake.planning import IrisZo, IrisZoOptions

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", type=Path)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--seeds", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    checker = checker_of(options.robot, options.pairs)
    plant = checker.plant()
    low, high = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    free = np.mean(
        [checker.CheckConfigCollisionFree(q) for q in np.random.default_rng(0).uniform(low, high, (5000, len(low)))]
    )
    print(f"{len(low)} joints, {100 * free:.1f} % of 5000 samples are free", flush=True)
    found: list[dict[str, Any]] = []
    for number, q in enumerate(json.loads(options.seeds.read_text())):
        how = IrisZoOptions()
        how.sampled_iris_options.parallelism = Parallelism(1)
        wall, own = time.perf_counter(), time.process_time()
        try:
            one = IrisZo(checker, Hyperellipsoid.MakeHypersphere(1e-2, q), HPolyhedron.MakeBox(low, high), how)
        except RuntimeError as error:
            print(f"seed {number}: {error}", flush=True)
            found.append({"A": [], "b": []})
            continue
        seconds = [time.process_time() - own, time.perf_counter() - wall]
        print(f"seed {number}: {len(one.b())} faces, {seconds[0]:.1f} s of processor, {seconds[1]:.1f} s", flush=True)
        found.append({"A": one.A().tolist(), "b": one.b().tolist(), "seconds": seconds})
        options.out.write_text(json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
