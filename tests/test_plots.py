"""Figures of one robot agree: a boundary has one colour on a page, and a robot is seen from where it moves."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pytest
import shapely
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

import pinbound as pb
from pinbound.figures.colours import PALETTE, order_of, style_of
from pinbound.figures.motion_figure import draw_motion
from pinbound.figures.plots import draw_region, draw_robot, draw_workspace, side_axes
from robots import joint, robot_xml


def light(colour: object) -> float:
    """Return the relative luminance of a colour, as contrast of text is defined by."""
    parts = np.array(to_rgb(colour))  # type: ignore[arg-type]
    linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one: object, other: object) -> float:
    low, high = sorted((light(one), light(other)))
    return (high + 0.05) / (low + 0.05)


def lines(figure: Figure) -> dict[str, str]:
    """Return the colours of lines by their labels, as the legend shows them."""
    axes = figure.axes[0]
    return {str(line.get_label()): to_hex(line.get_color()) for line in axes.lines if line.get_label()[:1] != "_"}


def named(figure: Figure) -> dict[str, object]:
    """Return the colours of the names beside edges."""
    return {text.get_text(): text.get_color() for text in figure.axes[0].texts}


def test_a_boundary_has_one_colour_in_all_figures_of_a_page() -> None:
    """beta_3 was blue in the region, green in the robot beside it."""
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    order = order_of(region, robot.boundaries.names)
    assert set(order) == set(robot.boundaries.names)
    told = {name: to_hex(style_of(name, order)["color"]) for name in order}
    assert {name: one for name, one in lines(draw_robot(robot, robot.home, region)).items() if name in told} == told
    names = {edge.name for edge in region.edges}
    for figure in (draw_region(region, robot.home[[1, 2]]), draw_workspace(robot, region, "link_6")):
        drawn = {to_hex(line.get_color()) for line in figure.axes[0].lines if line.get_linewidth() == 3.0}
        assert drawn == {told[name] for name in names}
        assert names <= set(named(figure))


def test_plots_and_motions_have_the_colours_of_a_region_that_is_given() -> None:
    """Tutorial 1 drew beta_3 blue in the region and green on the robot below it."""
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot, ("q2", "q3"))
    told = {
        edge.name: to_hex(style_of(edge.name, order_of(region, robot.boundaries.names))["color"])
        for edge in region.edges
    }
    assert told.items() <= lines(robot.plot(region=region).figure).items()
    seen = pb.history(robot, np.radians([[0, 0, 0], [0, 60, 60]]), samples=9)
    drawn = lines(draw_motion(seen, region=region))
    shown = set(drawn) & set(told)
    assert len(shown) >= 3
    assert {name: drawn[name] for name in shown} == {name: told[name] for name in shown}


def test_a_region_fills_the_width_of_its_figure() -> None:
    """Axes of equal scales left a quarter of the width white, and letters were smaller by as much."""
    axes = pb.feasible_region(pb.load("minervabot_v3"), ("q2", "q3")).plot()
    axes.figure.draw_without_rendering()
    width, shown = axes.figure.get_size_inches()[0], axes.figure.get_tightbbox()
    assert shown.x0 >= 0.0
    assert shown.x1 <= width
    assert width - (shown.x1 - shown.x0) < 0.3


def test_more_names_than_colours_are_told_apart_by_their_lines() -> None:
    names = [f"b{index}" for index in range(2 * len(PALETTE))]
    order = order_of(None, names)
    styles = {(style_of(name, order)["color"], str(style_of(name, order)["linestyle"])) for name in names}
    assert len(styles) == len(names)


def test_names_can_be_read_on_white_and_on_the_fill_of_a_region() -> None:
    region = pb.feasible_region(pb.load("minervabot_v3"))
    found = named(draw_region(region, np.zeros(2)))
    assert len(found) == len(region.edges)
    for colour in found.values():
        assert min(contrast(colour, "white"), contrast(colour, "#DCEBF5")) > 4.5


def test_names_of_implied_contacts_stay_inside_the_axes() -> None:
    """beta_2's line leaves through the corner; its name was cut there."""
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    figure = draw_region(region, robot.home[[1, 2]], [("beta_2", np.array([-1.0, 1.0]), np.radians(-78.0))])
    figure.draw_without_rendering()
    (text,) = (one for one in figure.axes[0].texts if one.get_text() == "beta_2")
    box, frame = text.get_window_extent(), figure.axes[0].get_window_extent()
    assert frame.x0 <= box.x0
    assert box.x1 <= frame.x1
    assert frame.y0 <= box.y0
    assert box.y1 <= frame.y1


JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="0.3 0 0.2"/>
<axis xyz="{4}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint><link name="{3}"/>"""


@pytest.mark.parametrize(
    ("axes", "seen"),
    [
        (("0 0 1", "0 1 0", "0 1 0"), (0, 2)),
        (("0 0 1", "1 0 0", "1 0 0"), (1, 2)),
        (("0 0 1", "0 0 1", "0 0 1"), (0, 1)),
        (("0 0 1", "0 0 1", "0 -1 0"), (0, 2)),
    ],
)
def test_a_robot_is_seen_from_the_side_in_which_it_moves(
    load_text: Callable[..., pb.Robot], axes: tuple[str, str, str], seen: tuple[int, int]
) -> None:
    """An arm that lies flat at home was seen from above, where its joints are points on one line."""
    joints = "".join(JOINT.format(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", axis) for k, axis in enumerate(axes))
    robot = load_text(f'<robot name="arm"><link name="l0"/>{joints}</robot>')
    assert side_axes(robot, robot.home) == seen
    figure = draw_robot(robot, robot.home)
    assert figure.axes[0].get_xlabel()[0] == "xyz"[seen[0]]
    assert figure.axes[0].get_ylabel()[0] == "xyz"[seen[1]]


def test_regions_robots_and_certificates_draw_themselves_in_axes_that_are_given() -> None:
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot, ("q2", "q3"))
    certificate = pb.certify(robot, [robot.home, [0.0, 0.0, 1.05]])
    figure = Figure(figsize=(15, 5))
    panels = figure.subplots(1, 3)
    for draw, axes in zip((region.plot, lambda ax: robot.plot(ax=ax), certificate.plot), panels, strict=True):
        assert draw(axes) is axes
    assert {text.get_text() for text in panels[0].texts} >= {edge.name for edge in region.edges}
    assert panels[1].get_title(loc="left").startswith("minervabot_v3 at home")
    assert robot.plot([0.0, 0.3, 0.2]).get_title(loc="left").startswith("minervabot_v3 at q1 = 0 deg, q2 = 17.1887 deg")
    names = [label.get_text() for label in panels[2].get_yticklabels()]
    assert names[0] == certificate.tightest.name  # type: ignore[union-attr]
    assert set(names) == set(robot.boundaries.names)
    ends = {name: float(bar.get_x() + bar.get_width()) for name, bar in zip(names, panels[2].patches, strict=True)}
    for finding in certificate.boundaries:
        proven = finding.lower if finding.verdict is pb.Verdict.CERTIFIED else finding.upper
        assert ends[finding.name] == pytest.approx(1e3 * proven, abs=1e-6)
    with pytest.raises(pb.DimensionError):
        robot.plot([0.0, np.nan, 0.0])


def test_a_notebook_shows_pictures_and_formulas_in_which_names_are_no_markup() -> None:
    robot = pb.load("minervabot_v3")
    shown = (pb.feasible_region(robot, ("q2", "q3")), robot, pb.certify(robot, [robot.home, [0.0, 0.3, 0.2]]))
    starts = ("&lt;Region (q2, q3): beta_7,", "&lt;Robot minervabot_v3", "&lt;Certificate certified")
    for one, start in zip(shown, starts, strict=True):
        page = one._repr_html_()
        assert page.startswith("<svg")
        assert f"<pre>{start}" in page
    boundary = robot.boundaries["beta_4"]
    assert boundary._repr_latex_() == rf"$\displaystyle r = {boundary.latex()}\ \mathrm{{m}}$"
    none = pb.load(robot_xml([joint("q1", "revolute", "base", "a", limit="-1 1")], {}, []))
    assert pb.certify(none, [[0.0], [0.5]])._repr_html_().startswith("<svg")


def crowd(load_text: Callable[..., pb.Robot], count: int) -> pb.Robot:
    """A planar arm whose hand has to keep away from a row of posts: one boundary each."""
    joints = [
        joint("q1", "revolute", "base", "a", axis="0 1 0", limit="-2.6 2.6"),
        joint("q2", "revolute", "a", "b", axis="0 1 0", xyz="0.5 0 0", limit="-2.6 2.6"),
        joint("q3", "fixed", "b", "tool", xyz="0.4 0 0"),
    ]
    marks = '<pinbound:point name="hand" link="b" xyz="0.4 0 0" radius="0.03"/>'
    for k in range(count):
        marks += f'<pinbound:point name="post_{k}" link="base" xyz="{0.05 * k - 0.5} 0 -0.4" radius="0.03"/>'
        marks += f'<pinbound:boundary name="hand-post_{k}" a="hand" b="post_{k}"/>'
    return load_text(robot_xml(joints, {}, [], '<pinbound:home q1="-1" q2="0.2"/>' + marks))


def overlaps(figure: Figure) -> list[tuple[str, str]]:
    """Return pairs of names whose boxes overlap, and names that leave the axes."""
    figure.draw_without_rendering()
    axes = figure.axes[0]
    frame, boxes = axes.get_window_extent(), [(one.get_text(), one.get_window_extent()) for one in axes.texts]
    cut = [(name, "axes") for name, box in boxes if box.x0 < frame.x0 or box.x1 > frame.x1 or box.y1 > frame.y1]
    level = [
        (text.get_text(), box) for text, (_, box) in zip(axes.texts, boxes, strict=True) if not text.get_rotation()
    ]
    return cut + [(a, b) for i, (a, one) in enumerate(level) for b, other in level[:i] if one.overlaps(other)]


def test_of_many_boundaries_a_robot_shows_the_nearest(load_text: Callable[..., pb.Robot]) -> None:
    """Of 78 pairs of the Panda all lines were drawn, and none could be followed."""
    robot = crowd(load_text, 24)
    figure = draw_robot(robot, robot.home)
    clearances = robot.boundaries.signed_clearances(robot.home)
    nearest = {robot.boundaries.names[index] for index in np.argsort(clearances)[:12]}
    assert set(lines(figure)) == nearest
    assert "the 12 of 24 pairs nearest contact" in figure.axes[0].get_title(loc="left")
    few = crowd(load_text, 5)
    assert set(lines(draw_robot(few, few.home))) == set(few.boundaries.names)


def test_names_do_not_cover_each_other_and_edges_without_room_are_in_a_legend(
    load_text: Callable[..., pb.Robot],
) -> None:
    """o25 and o26 of MinervaBotV3 collided; names of short edges were written over each other."""
    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    for figure in (
        draw_robot(robot, robot.home, region),
        draw_region(region, robot.home[1:]),
        draw_workspace(robot, region, "link_6"),
    ):
        assert overlaps(figure) == []
    many = crowd(load_text, 9)
    region = pb.feasible_region(many)
    figure = draw_region(region, many.home)
    assert overlaps(figure) == []
    axes = figure.axes[0]
    listed = {text.get_text() for text in axes.get_legend().get_texts()}
    written = {text.get_text() for text in axes.texts}
    assert listed
    assert listed | written == {edge.name for edge in region.edges}
    assert not listed & written


def test_no_text_of_a_figure_is_cut_off() -> None:
    """With axes of equal aspect the layout takes several passes, more where a legend stands beside them."""
    robot = pb.load("palletizer", xacro_args={"flange_width": "0.2"})
    region = pb.feasible_region(robot, ("J2", "J3"))
    figure = draw_region(region, region.points(robot.home)[0])
    figure.draw_without_rendering()  # as saving does
    (width, height), shown = figure.get_size_inches(), figure.get_tightbbox()
    assert figure.axes[0].get_legend().get_title().get_text().startswith("edges without room")
    assert min(shown.x0, shown.y0, width - shown.x1, height - shown.y1) >= 0.0


def test_the_filled_image_of_a_region_is_what_the_link_reaches(load_text: Callable[..., pb.Robot]) -> None:
    """An arm folds at its elbow: the image of the edges alone, filled, left out places that the hand reaches."""
    robot = crowd(load_text, 2)
    region = pb.feasible_region(robot)
    assert not pb.workspace_section(robot, region, "tool").is_one_to_one
    figure = draw_workspace(robot, region, "tool")
    (patch,) = figure.axes[0].patches
    rng = np.random.default_rng(0)
    Q = rng.uniform(robot.lower, robot.upper, (300, 2))
    reached = 1e3 * robot.positions("tool", Q[region.contains(Q)])[:, [0, 2]]
    rings = [shapely.Polygon(ring) for ring in patch.get_path().to_polygons()]
    filled = functools.reduce(shapely.symmetric_difference, rings).buffer(1.0)  # [mm]
    assert shapely.contains_xy(filled, *reached.T).all()
    assert not shapely.contains_xy(filled, 0.0, 0.0)  # the shoulder


def test_a_boundary_has_the_same_line_as_swatch_and_in_the_figure() -> None:
    from pinbound.figures.report import _swatches

    robot = pb.load("minervabot_v3")
    region = pb.feasible_region(robot)
    order = order_of(region, robot.boundaries.names)
    swatches = _swatches(robot, region)
    assert set(swatches) == {edge.name for edge in region.edges}
    assert all(style_of(name, order)["color"] in told for name, told in swatches.items())
