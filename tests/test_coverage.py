"""Coverage: what marks hold is proven, what boundaries watch follows, and what nobody looks at is said."""

import itertools
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pinbound as pb
from pinbound.annotations import Line, Mark, Plane, Point, Segment, Sweep
from pinbound.coverage import Basis, Status
from pinbound.coverage.bodies import Body
from pinbound.coverage.covers import cover
from pinbound.coverage.holding import holders, holds
from pinbound.coverage.reach import Reach
from pinbound.evaluate import separation
from pinbound.evaluate.closest import nearest
from pinbound.path.relative import relative_path
from robots import joint
from test_loop_errors import crank_loop

SIZES = {"sphere": (0.1,), "box": (0.3, 0.1, 0.05), "cylinder": (0.05, 0.4), "capsule": (0.05, 0.3)}
HEAD = '<robot name="r" xmlns:pinbound="urn:pinbound:1">'


def turned(shape: str, rng: np.random.Generator, size: tuple[float, ...] | None = None) -> Body:
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return Body("l", 0, shape, size or SIZES[shape], rotation, rng.uniform(-0.2, 0.2, 3))


def surface(body: Body, rng: np.random.Generator, count: int = 4000) -> np.ndarray:
    """Return points of a body in its link's frame, most of them on its surface, its edges and its corners."""
    if body.shape == "box":
        points = rng.uniform(-0.5, 0.5, (count, 3))
        points = np.where(rng.random((count, 3)) < 0.7, np.sign(points) / 2, points) * body.size
    else:
        way = rng.normal(size=(count, 3))
        way /= np.linalg.norm(way, axis=1)[:, None]
        if body.shape == "cylinder":
            angle = rng.uniform(0.0, 2.0 * np.pi, count)
            height = np.where(
                rng.random(count) < 0.7, np.sign(rng.normal(size=count)) / 2, rng.uniform(-0.5, 0.5, count)
            )
            ring = np.column_stack((np.cos(angle), np.sin(angle)))
            points = np.column_stack((ring * body.size[0], height * body.size[1]))
        else:
            points = way * body.size[0]
            if body.shape == "capsule":
                points[:, 2] += np.where(points[:, 2] > 0.0, 0.5, -0.5) * body.size[1]
    return points @ body.rotation.T + body.translation


def outside(mark: Mark, points: np.ndarray) -> np.ndarray:
    """Return how far points are outside a mark [m]; negative or zero inside."""
    ways = np.array(mark.ways).reshape(-1, 1, 3)
    w, e = np.array(mark.xyz) - points, np.repeat(ways, len(points), axis=1)
    return np.linalg.norm(w + np.einsum("nk,kni->ni", nearest(w, e), e), axis=1) - mark.radius


@pytest.mark.parametrize("shape", SIZES)
def test_what_is_said_to_be_held_is_held(shape: str) -> None:
    """Random marks about random bodies: no point of a body that is held is outside; both answers come often."""
    rng, counts = np.random.default_rng(5), [0, 0]
    for _ in range(300):
        body = turned(shape, rng)
        near = (body.translation + rng.normal(size=3) * 0.02).tolist()
        ways = [tuple(w) for w in (rng.normal(size=(int(rng.integers(1, 5)), 3)) * 0.2).tolist()]
        corner = (np.array(near) - np.sum(ways, axis=0) / 2).tolist()
        far = (np.array(near) + body.rotation[:, 2] * 0.2).tolist()
        start = (np.array(near) - body.rotation[:, 2] * 0.2).tolist()
        radius = float(rng.uniform(0.0, 0.3))
        marks = [Point("p", "l", tuple(near), radius), Segment("s", "l", tuple(start), tuple(far), radius)]
        for mark in [*marks, Sweep("b", "l", tuple(corner), tuple(ways), radius)]:
            found = holds(mark, body)
            counts[found] += 1
            if found:
                assert np.max(outside(mark, surface(body, rng, 1000))) <= 1e-11
    assert min(counts) > 40


@pytest.mark.parametrize("shape", SIZES)
@pytest.mark.parametrize("accuracy", [0.05, 0.003])
@pytest.mark.parametrize("by", ["bodies", "spheres"])
def test_covers_hold_their_bodies_and_thinner_ones_do_not(shape: str, accuracy: float, by: str) -> None:
    rng = np.random.default_rng(6)
    body = turned(shape, rng)
    marks = cover(body, accuracy, by).marks
    (used,) = holders(body, marks)
    chosen = [mark for mark in marks if mark.name in used]
    points = surface(body, rng)
    assert np.max(np.min([outside(mark, points) for mark in chosen], axis=0)) <= 1e-11
    for less in (1e-6, 1e-10):
        assert holders(body, [thinner(mark, less) for mark in marks]) == ()


def thinner(mark: Mark, less: float) -> Mark:
    if isinstance(mark, Point):
        return Point(mark.name, mark.link, mark.xyz, mark.radius - less)
    if isinstance(mark, Segment):
        return Segment(mark.name, mark.link, mark.xyz_a, mark.xyz_b, mark.radius - less)
    *others, last = mark.ways  # along its last way it is exactly as long as the body
    return Sweep(mark.name, mark.link, mark.xyz, (*others, tuple((1 - less) * x for x in last)))


def test_a_union_of_spheres_with_a_hole_holds_nothing() -> None:
    rng, holes = np.random.default_rng(7), 0
    for shape in ("box", "cylinder", "capsule"):
        body = turned(shape, rng)
        marks = list(cover(body, 0.01, "spheres").marks)
        points = surface(body, rng, 20_000)
        for index in range(len(marks)):
            rest = [mark for place, mark in enumerate(marks) if place != index]
            found = holders(body, rest)
            if np.max(np.min([outside(mark, points) for mark in rest], axis=0)) > 1e-9:
                assert found == ()
                holes += 1
    assert holes > 10


def test_loose_spheres_off_the_axis_are_proven_by_cutting() -> None:
    rng = np.random.default_rng(8)
    for shape in SIZES:
        body = turned(shape, rng)
        half = np.max(np.abs((surface(body, rng) - body.translation) @ body.rotation), axis=0)
        places = itertools.product(*(np.linspace(-h, h, 4) for h in half))
        grid = np.array(list(places)) + rng.normal(size=(64, 3)) * 1e-3
        radius = 0.75 * float(np.linalg.norm(2 * half / 3))
        places = grid @ body.rotation.T + body.translation
        marks = [Point(str(k), "l", tuple(xyz), radius) for k, xyz in enumerate(places.tolist())]
        found = holders(body, marks)
        assert found
        points = surface(body, rng)
        chosen = [mark for mark in marks if mark.name in found[0]]
        assert np.max(np.min([outside(mark, points) for mark in chosen], axis=0)) <= 1e-11


def test_planes_lines_and_meshes() -> None:
    ball = Body("l", 0, "sphere", (0.1,), np.eye(3), np.zeros(3))
    flat: list[Mark] = [Plane("p", "l", (0, 0, 1), (0, 0, 1)), Line("n", "l", (0, 0, 0), (0, 0, 1), 1.0)]
    assert holders(ball, flat) == ()
    assert holders(Body("l", 0, "mesh", (), np.eye(3), np.zeros(3)), [Point("q", "l", (0, 0, 0), 9.0)]) == ()


def body_of(shape: str, size: str, xyz: str = "0 0 0") -> str:
    key = {"sphere": "radius", "box": "size"}[shape]
    return f'<collision><origin xyz="{xyz}"/><geometry><{shape} {key}="{size}"/></geometry></collision>'


def arm(bodies: dict[str, str], notes: str = "", joints: list[str] | None = None) -> str:
    """Return an arm base - a - b - c - d of four joints, with bodies on its links."""
    text = (
        HEAD
        + '<link name="base"/>'
        + "".join(joints or JOINTS)
        + f"<pinbound:annotations>{notes}</pinbound:annotations>"
    )
    for link, inside in bodies.items():
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{inside}</link>')
    return text + "</robot>"


JOINTS = [
    joint("j1", "revolute", "base", "a", axis="0 0 1", xyz="0 0 0.3"),
    joint("j2", "revolute", "a", "b", axis="0 1 0", xyz="0.05 0.02 0.1"),
    joint("j3", "revolute", "b", "c", axis="0 1 0", xyz="0 0 0.5"),
    joint("j4", "revolute", "c", "d", axis="1 0 0", xyz="0.02 0 0.4"),
]
BALLS = {name: body_of("sphere", "0.05") for name in ("base", "a", "b", "c", "d")}
MARKS = "".join(f'<pinbound:point name="{n}" link="{n}" xyz="0 0 0" radius="0.05"/>' for n in BALLS)


def boundary(a: str, b: str) -> str:
    return f'<pinbound:boundary name="{a}-{b}" a="{a}" b="{b}"/>'


LoadText = Callable[..., pb.Robot]


def status(robot: pb.Robot) -> dict[tuple[str, str], Status]:
    return {pair.links: pair.status for pair in robot.coverage.pairs}


def test_every_status_and_reason(load_text: LoadText) -> None:
    fixed = joint("weld", "fixed", "d", "tool", xyz="0 0 0.02")
    bodies = BALLS | {"tool": '<collision><geometry><mesh filename="x.stl"/></geometry></collision>'}
    said = '<pinbound:left_out a="tool" b="a" reason="the cable keeps them apart"/>'
    robot = load_text(arm(bodies, MARKS + boundary("base", "d") + said, [*JOINTS, fixed]))
    pairs = {pair.links: pair for pair in robot.coverage.pairs}
    assert len(pairs) == 15
    assert pairs["base", "d"].status is Status.WATCHED
    assert pairs["base", "d"].boundaries == ("base-d",)
    for links in (("base", "a"), ("a", "b"), ("b", "c"), ("c", "d"), ("c", "tool")):
        assert (pairs[links].status, pairs[links].basis) == (Status.LEFT_OUT, Basis.NEIGHBOURS)
    assert (pairs["d", "tool"].basis, pairs["d", "tool"].reason) == (Basis.PROOF, "never move against each other")
    # |base b| >= 0.3 m, |b d| >= 0.1 m, |a c| >= 0.4 m, all balls have 50 mm; base and c come to 0.19 m at least
    for links in (("base", "b"), ("a", "c")):
        assert (pairs[links].status, pairs[links].reason) == (Status.LEFT_OUT, "can never meet")
    assert pairs["a", "tool"].basis is Basis.SAID
    assert "robot.urdf: the cable keeps them apart" in pairs["a", "tool"].reason
    assert pairs["a", "d"].status is Status.UNWATCHED
    assert pairs["base", "tool"].status is Status.UNWATCHED
    tool = robot.coverage.links["tool"].bodies[0]
    assert not tool.is_held
    assert "mesh" in tool.reason
    assert robot.coverage.links["d"].bodies[0].held_by == (("d",),)
    record = robot.coverage.record
    assert record.watched + record.in_part + record.proven + record.neighbours + record.said + record.unwatched == 15
    assert (
        f"watches 1 of 15 pairs of links; left out: 5 neighbours, {record.proven} that cannot touch" in record.summary
    )
    assert f"1 as a file says; {record.unwatched} not watched; 1 body is held by no mark" in record.summary
    assert not robot.coverage.is_complete
    assert pickle.loads(pickle.dumps(robot)).coverage.record == record


def test_what_can_never_meet_is_not_sampled(load_text: LoadText) -> None:
    """Over random arms: what is proven apart stays apart at 5,000 configurations."""
    rng = np.random.default_rng(9)
    proven = 0
    for _ in range(24):
        joints = [
            joint(f"j{k}", "continuous", parent, child, axis=" ".join(map(str, axis)), xyz=" ".join(map(str, xyz)))
            for (k, (parent, child)), axis, xyz in zip(
                enumerate(itertools.pairwise(["base", "a", "b", "c"])),
                np.eye(3)[rng.integers(0, 3, 3)].tolist(),
                rng.uniform(-0.4, 0.4, (3, 3)).tolist(),
                strict=True,
            )
        ]
        robot = load_text(arm({}, joints=joints))
        Q = rng.uniform(-np.pi, np.pi, (5_000, 3))
        for link in ("b", "c"):
            corner, ways = rng.uniform(-0.3, 0.3, 3), rng.normal(size=(2, 3)) * 0.1
            marks: list[Mark] = [
                Point("p", link, tuple(corner), float(rng.uniform(0.0, 0.1))),
                *(
                    Sweep("s", link, tuple(corner - size * ways.sum(axis=0) / 2), tuple(map(tuple, size * ways)), 0.02)
                    for size in (1.0, 3.0)
                ),
            ]
            ball = Point("o", "base", tuple(rng.uniform(-0.3, 0.3, 3)), 0.03)
            for mark in marks:
                if not Reach(robot.tree, robot.coupling, "base", link).never_meet([ball], [mark]):
                    continue
                proven += 1
                path = relative_path(robot.tree, robot.coupling, ball, mark)
                assert np.min(separation.separations(path, Q)) > ball.radius + mark.radius
    assert proven > 5


def test_one_angle_is_proven_apart_to_the_last_micrometre(load_text: LoadText) -> None:
    joints = [joint("j1", "continuous", "base", "a", xyz="0.3 0 0"), joint("j2", "continuous", "a", "b", xyz="0 0 0")]
    robot = load_text(arm({}, joints=joints))
    reach = Reach(robot.tree, robot.coupling, "base", "b")
    arm_end = Point("s", "b", (0.1, 0.0, 0.0), 0.0)
    for radius, apart in ((0.2 - 1e-6, True), (0.2, False), (0.2 + 1e-6, False)):
        assert reach.never_meet([Point("p", "base", (0.0, 0.0, 0.0), radius)], [arm_end]) is apart
    bar = Segment("bar", "b", (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 0.0)
    for radius, apart in ((0.198, True), (0.2004, False)):
        assert reach.never_meet([Point("p", "base", (0.0, 0.0, 0.0), radius)], [bar]) is apart


def test_two_bodies_are_watched_only_if_all_pairs_of_their_marks_are(load_text: LoadText) -> None:
    bodies = {"base": body_of("box", "0.2 0.1 0.1"), "d": body_of("sphere", "0.05")}
    halves = "".join(
        f'<pinbound:point name="{n}" link="base" xyz="{x} 0 0" radius="0.0867"/>'
        for n, x in (("l", -0.05), ("r", 0.05))
    )
    one = '<pinbound:point name="d" link="d" xyz="0 0 0" radius="0.05"/>'
    both = load_text(arm(bodies, halves + one + boundary("l", "d") + boundary("r", "d")))
    assert status(both) == {("base", "d"): Status.WATCHED}
    assert both.coverage.is_complete
    assert both.coverage.of(["l-d"]).pairs[0].status is Status.IN_PART
    assert not both.coverage.of(["l-d"]).is_complete
    part = load_text(arm(bodies, halves + one + boundary("l", "d")))
    assert status(part) == {("base", "d"): Status.IN_PART}
    rest = '<pinbound:left_out a="base" b="d" reason="r is inside"/>'
    stated = load_text(arm(bodies, halves + one + boundary("l", "d") + rest))
    assert status(stated) == {("base", "d"): Status.IN_PART}
    assert stated.coverage.is_complete
    thin = load_text(arm(bodies, halves.replace("0.0867", "0.0866") + one + boundary("l", "d") + boundary("r", "d")))
    assert status(thin) == {("base", "d"): Status.IN_PART}
    assert "not proven" in thin.coverage.links["base"].bodies[0].reason
    assert "1 body is held by no mark" in thin.coverage.summary


def test_points_without_radius_hold_nothing(minerva: pb.Robot) -> None:
    coverage = minerva.coverage
    assert (len(coverage.watched), len(coverage.in_part)) == (0, 7)
    assert sum(len(pair.boundaries) for pair in coverage.in_part) == 10
    assert "7 at marked points only" in coverage.summary
    assert not any(body.is_held for body in coverage.bodies)


def test_links_without_bodies(load_text: LoadText) -> None:
    robot = load_text(arm({}, MARKS + boundary("base", "d")))
    assert robot.coverage.pairs == ()
    assert not robot.coverage.is_complete
    assert robot.coverage.summary == "watches pairs of marks only (1); no link has a body"
    alone = load_text(arm({"base": BALLS["base"]}))
    assert alone.coverage.is_complete
    assert "only one link has a body" in alone.coverage.summary


def test_a_free_joint_between_is_said(load_text: LoadText) -> None:
    joints = [
        '<joint name="f" type="floating"><parent link="base"/><child link="a"/></joint><link name="a"/>',
        *JOINTS[1:],
    ]
    robot = load_text(arm({"base": BALLS["base"], "d": BALLS["d"]}, joints=joints))
    (pair,) = robot.coverage.pairs
    assert pair.status is Status.UNWATCHED
    assert "free joint" in pair.reason


def test_left_out_is_read_and_written_alike(load_text: LoadText, tmp_path: Path) -> None:
    item = pb.LeftOutMark("a", "d", "a cover: it's closed")
    annotations = pb.Annotations.of([], left_out=(item,))
    text = arm(BALLS)
    from_yaml = load_text(text, annotations.to_yaml())
    (tmp_path / "robot.pinbound.yaml").unlink()
    from_xml = load_text(text.replace("<pinbound:annotations></pinbound:annotations>", annotations.to_xml()))
    for robot in (from_yaml, from_xml):
        (found,) = robot.annotations.left_out
        assert (found.a, found.b, found.reason) == ("a", "d", item.reason)
        pair = next(pair for pair in robot.coverage.left_out if pair.links == ("a", "d"))
        assert pair.basis is Basis.SAID
        assert pair.reason == f"said by {found.source}: {item.reason}"
    assert from_yaml.annotations.left_out[0].source == "robot.pinbound.yaml"


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{a: a, b: dd, reason: x}", "(?s)line 1.*names the link 'dd'.*Did you mean 'd'"),
        ("{a: a, b: d, reason: ''}", "left_out 'a-d' has no reason"),
        ("{a: a, b: d}", "left_out 'a-d' has no reason"),
        ("{a: a, b: a, reason: x}", "names one link twice"),
        ("{a: a, b: d, reason: x, link: c}", "unknown attribute 'link'"),
    ],
)
def test_faults_of_left_out(load_text: LoadText, entry: str, message: str) -> None:
    with pytest.raises(pb.InputError, match=message):
        load_text(arm(BALLS), f"left_out: [{entry}]\n")


def test_disabled_pairs_of_an_srdf_are_left_out_as_said(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(arm(BALLS))
    srdf = tmp_path / "arm.srdf"
    srdf.write_text(
        '<robot name="r"><disable_collisions link1="d" link2="a" reason="Never"/>'
        '<disable_collisions link1="d" link2="camera" reason="Adjacent"/></robot>'
    )
    coverage = pb.load(tmp_path / "arm.urdf", annotations=srdf).coverage
    pair = next(pair for pair in coverage.pairs if pair.links == ("a", "d"))
    assert (pair.status, pair.basis, pair.reason) == (Status.LEFT_OUT, Basis.SAID, "said by arm.srdf: Never")
    assert coverage.notes == ("arm.srdf leaves out pairs of 'camera', which is not a link",)


def test_a_statement_is_no_proof_and_a_proof_needs_no_statement(load_text: LoadText) -> None:
    said = "".join(f'<pinbound:left_out a="{a}" b="{b}" reason="can never meet"/>' for a, b in ("ad", ("base", "b")))
    pairs = {pair.links: pair for pair in load_text(arm(BALLS, said)).coverage.pairs}
    assert pairs["a", "d"].basis is Basis.SAID  # they do meet
    assert pairs["base", "b"].basis is Basis.PROOF


def test_certificates_record_the_coverage_of_what_they_checked(load_text: LoadText) -> None:
    robot = load_text(arm(BALLS, MARKS + boundary("base", "d") + boundary("a", "d")))
    motion = [robot.home, robot.home + 0.01]
    found = pb.certify(robot, motion)
    assert found.coverage == robot.coverage.record
    assert found.coverage.summary in repr(found)
    one = pb.certify(robot, motion, boundaries=["a-d"])
    assert (one.coverage.watched, found.coverage.watched) == (1, 2)
    assert pickle.loads(pickle.dumps(one)).coverage == one.coverage
    box = pb.certify_box(robot, robot.home, robot.home, boundaries=["base-d"])
    assert box.coverage == robot.coverage.of(["base-d"]).record
    assert box.coverage.summary in repr(box)
    with pytest.raises(pb.UnknownNameError):
        robot.coverage.of(["d-a"])


def test_boundaries_of_a_proposal_watch_what_it_covers(load_text: LoadText) -> None:
    bodies = BALLS | {"c": body_of("box", "0.05 0.05 0.3", "0 0 0.2"), "d": body_of("box", "0.1 0.04 0.04")}
    proposal = pb.propose_marks(load_text(arm(bodies)))
    marked = load_text(arm(bodies), proposal.annotations.to_yaml())
    assert len(marked.coverage.watched) > 0
    assert {pair.status for pair in marked.coverage.pairs} <= {Status.WATCHED, Status.LEFT_OUT}
    assert marked.coverage.is_complete
    names = {frozenset((b.point_a.link, b.point_b.link)) for b in marked.boundaries}
    assert {frozenset(pair.links) for pair in marked.coverage.watched} == names


def test_a_proposal_states_what_overlaps_by_design_and_leaves_open_what_it_does_not_cover(load_text: LoadText) -> None:
    bodies = BALLS | {
        "base": body_of("sphere", "0.6"),  # holds the shoulder of b at every q
        "d": '<collision><geometry><mesh filename="x.stl"/></geometry></collision>',
    }
    proposal = pb.propose_marks(load_text(arm(bodies)))
    stated = {(one.a, one.b): one.reason for one in proposal.annotations.left_out}
    assert stated["base", "b"] == "always overlap"  # proven: b turns about a point inside
    marked = load_text(arm(bodies), proposal.annotations.to_yaml())
    pairs = {pair.links: pair for pair in marked.coverage.pairs}
    assert (pairs["base", "b"].status, pairs["base", "b"].basis) == (Status.LEFT_OUT, Basis.SAID)
    assert pairs["base", "b"].reason.startswith("said by robot.pinbound.yaml: always overlap")
    assert pairs["a", "c"].basis is Basis.PROOF
    for other in ("base", "a", "b"):
        assert pairs[other, "d"].is_open


@pytest.mark.parametrize("off", [0.0, 8e-5])
def test_behind_a_loop_whose_sides_differ_nothing_is_proven_to_stay_apart(load_text: LoadText, off: float) -> None:
    text = crank_loop(off, tolerance=1e-4).urdf()
    for link in ("base", "coupler"):
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{body_of("sphere", "0.055")}</link>')
    (pair,) = load_text(text).coverage.pairs  # the coupler's pivot stays 120 mm from the base's, if the loop is exact
    assert pair.basis is (None if off else Basis.PROOF)


def test_lines_and_planes_watch_in_part_about_a_single_joint() -> None:
    """Nothing holds them in a ball, so that no proof of staying apart is tried on them."""
    body = '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
    marks = [
        Plane("floor", "base", (0.0, 0.0, -0.5), (0.0, 0.0, 1.0)),
        Line("pole", "base", (0.6, 0.5, 0.0), (0.0, 0.0, 1.0), 0.01),
        Point("hand", "arm", (0.0, 0.0, 0.0), 0.06),
    ]
    bounds = [pb.BoundaryMark("above", "floor", "hand"), pb.BoundaryMark("beside", "pole", "hand")]
    arm = joint("j", "revolute", "base", "arm", xyz="0 0 1").replace(
        '<link name="arm"/>', f'<link name="arm">{body}</link>'
    )
    text = f'{HEAD}<link name="base">{body}</link>{arm}</robot>'
    (pair,) = pb.load(text).with_annotations(pb.Annotations.of(marks, bounds)).coverage.pairs
    assert pair.status is Status.IN_PART
    assert set(pair.boundaries) == {"above", "beside"}
