"""The errata of the printed paper; each is a computation with its numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
import shapely

from pinbound.region import feasible_region
from pinbound.region.membership import Place, axis_membership, region_membership
from pinbound.reproduce.findings import Erratum
from pinbound.reproduce.judged import JudgedLimit
from pinbound.reproduce.study import PLANE, Study
from pinbound.robot.loading import load

__all__ = ["find_errata"]


def find_errata(study: Study, judged: Sequence[JudgedLimit]) -> tuple[Erratum, ...]:
    """Compute every erratum.

    Args:
        study: The paper's robot.
        judged: The sixteen limits of Eqs. (18)-(20).
    """
    return (
        _sign_of_the_norm(study),
        _bridge(study),
        _missing_offset(study),
        _limits(judged),
        _projection(study),
        _kinds(study),
        _two_names(study),
        _convexity(study),
        _third_line(study),
        _differentiable(study),
    )


def _sign_of_the_norm(study: Study) -> Erratum:
    X, norms, _ = study.samples
    robot, Q = study.robot, study.configurations(X)
    by_contacts = np.ones(len(X), dtype=np.bool_)
    for boundary in robot.boundaries:  # an independent check: each effective angle lies in the gap around home
        contact = study.contact(boundary.name)
        lower, upper = contact.gap(float(contact.coefficients @ robot.home))
        phi = Q @ contact.coefficients
        by_contacts &= (phi > lower) & (phi < upper)
    by_contacts &= np.all((Q >= robot.lower) & (Q <= robot.upper), axis=1)
    outside = ~by_contacts
    positive = np.all(norms > 0.0, axis=1)
    wrong = int(np.sum((study.region.signed_distance(Q) > 0.0) != by_contacts))
    numbers = {
        "samples": float(len(X)),
        "samples outside": float(outside.sum()),
        "outside with all norms positive": float(np.sum(outside & positive)),
        "smallest norm [m]": float(norms.min()),
        "signed distance of wrong sign": float(wrong),
    }
    return Erratum(
        1,
        "Eq. (1)",
        "A norm is never negative, and cannot be the boundary function that is defined",
        "beta < 0 outside the region; zero and positive are both given to q inside it",
        f"of {int(outside.sum()):,} random samples outside, {int(np.sum(outside & positive)):,} have all ten norms "
        f"positive; the smallest norm of all is {1e3 * norms.min():.4f} mm",
        f"A signed function is needed: clearance, or the signed distance to the region, wrong for {wrong} of "
        f"{len(X):,} samples",
        numbers,
        holds=bool(np.all(norms >= 0.0)) and numbers["outside with all norms positive"] > 0 and wrong == 0,
    )


def _bridge(study: Study) -> Erratum:
    x, z = study.pivot
    arguments = {"bridge": "as_printed", "pivot_x": f"{x / 1e3:.9g}", "pivot_z": f"{z / 1e3:.9g}"}
    printed = load("minervabot_v3", xacro_args=arguments)
    cut, level5, level6 = (
        float(np.degrees(one.contact(name).angle))
        for one, name in ((Study(printed), "beta_5"), (study, "beta_5"), (study, "beta_6"))
    )
    area = feasible_region(printed, PLANE).area
    low, high = np.degrees(study.region.vertices.min(axis=0)), np.degrees(study.region.vertices.max(axis=0))
    dips = [
        1e3 * float(study.robot.boundaries["beta_6"].norm(study.configurations(study.contour(region, 2000)[1])).min())
        for region in (study.region, study.scaled)
    ]
    return Erratum(
        2,
        "Tables 9, 10",
        "R_2,16 = R_y(q3) cannot be meant: the bridge keeps its orientation, R_2,16 = R_y(-q2)",
        f"with R_y(q3), beta_5 touches at q2 = {cut:.6f} degrees, in the middle of the region ({low[0]:.2f} to "
        f"{high[0]:.2f}), and leaves {area:.4f} of {study.region.area:.4f} rad^2",
        f"with the bridge level, beta_5 stops q3 at {level5:.6f} and beta_6 at {level6:.6f} degrees, just outside "
        f"{low[1]:.3f} (beta_9) and {high[1]:.3f} (beta_3)",
        f"beta_6 dips to {dips[0]:.3f} mm on the contour and only to {dips[1]:.3f} mm on the scaled one, as the text "
        "of Fig. 14 says. Neither is inverted in Eqs. (18)-(20)",
        {
            "beta_5 contact as printed, q2 [deg]": cut,
            "beta_5 contact level, q3 [deg]": level5,
            "beta_6 contact level, q3 [deg]": level6,
            "area as printed [rad^2]": area,
            "beta_6 smallest, contour [mm]": dips[0],
            "beta_6 smallest, scaled [mm]": dips[1],
        },
        holds=bool(low[0] < cut < high[0]) and level5 < low[1] and level6 > high[1] and dips[0] < dips[1],
    )


def _missing_offset(study: Study) -> Erratum:
    k = study.constants
    a, b = np.hypot(k["x_2,23"], k["z_2,23"]), np.hypot(k["x_3,24"], k["z_3,24"])
    printed = abs(float(a - b))
    smallest = 1e3 * study.contact("beta_8").smallest
    return Erratum(
        3,
        "Table 12",
        "The norm of beta_8 leaves out r_2,3; its components have it",
        f"|r_2,23 - R_2,3 r_3,24| is never below ||r_2,23| - |r_3,24|| = {printed:.4f} mm: no contact at any q",
        f"with r_2,3 it falls to {smallest:.4f} mm",
        "Read |r_2,23 - r_2,3 - R_2,3 r_3,24|; then norm, components and Eq. (17) agree",
        {"smallest norm as printed [mm]": printed, "smallest norm with r_2,3 [mm]": float(smallest)},
        holds=printed > 1.0 > smallest,
    )


def _limits(judged: Sequence[JudgedLimit]) -> Erratum:
    wrong = [one for one in judged if not one.solves]
    one_argument = sum(not one.solves_with_one_argument for one in judged)
    which = "; ".join(
        f"line {one.limit.line} of ({one.limit.equation}), beta_{one.limit.boundary},{one.limit.component}, leaves "
        f"{1e3 * one.residual:.3f} mm with the offset {one.limit.half_turns} pi and solves it with "
        f"{'none that was tried' if one.mended is None else f'{one.mended} pi'}"
        for one in wrong
    )
    worst = max(abs(float(np.degrees(one.difference))) for one in judged if one.solves)
    return Erratum(
        4,
        "Eqs. (18)-(20)",
        "One of sixteen limits has a wrong offset, and tan^-1 must be read with two arguments",
        "sixteen limits with offsets of 0 to 3 pi, and tan^-1 of quotients",
        f"read as atan2, {len(judged) - len(wrong)} of {len(judged)} solve their component equation; {which}. With the "
        f"arctangent of the quotient {one_argument} of {len(judged)} fail",
        "A root of one component is no contact: only a root that both share. The nearest printed branches lie up to "
        f"{worst:.4f} degrees from the contact angles, which is what lengths rounded to 0.01 mm do",
        {
            "right with atan2": float(len(judged) - len(wrong)),
            "wrong with one argument": float(one_argument),
            "largest residual of the wrong line [mm]": max((1e3 * one.residual for one in wrong), default=0.0),
            "largest branch less contact [deg]": worst,
        },
        holds=len(wrong) > 0,
    )


def _projection(study: Study) -> Erratum:
    q = study.configurations(np.radians([[0.0, 60.0]]))
    found = region_membership(study.robot, study.region, q)
    mu2, mu3 = (float(np.degrees(found.mu_printed[0, study.robot.coordinates.index(name)])) for name in PLANE)
    distance = float(np.degrees(found.signed_distance[0]))
    columns = [study.robot.coordinates.index(name) for name in PLANE]
    box = float(np.prod(found.upper[columns] - found.lower[columns]))
    share = 1.0 - study.region.area / box
    path = study.path
    unseen = np.all(path.membership.mu > 0.0, axis=1) & (path.place == Place.OUTSIDE)
    return Erratum(
        5,
        "Eq. (21), Fig. 22",
        "Projected on each axis, the region becomes its bounding box",
        f"at (q2, q3) = (0, 60) degrees mu_2 = {mu2:.3f} and mu_3 = {mu3:.3f} degrees: both positive",
        f"the signed distance there is {distance:.3f} degrees: outside, beyond beta_4",
        f"{100 * share:.1f} % of the box is outside the region. On the tool path {int(unseen.sum())} points are "
        "outside the scaled region with every mu positive",
        {
            "mu_2 at (0, 60) [deg]": mu2,
            "mu_3 at (0, 60) [deg]": mu3,
            "signed distance at (0, 60) [deg]": distance,
            "share of the box outside": share,
            "points of the tool path not seen": float(unseen.sum()),
        },
        holds=mu2 > 0 and mu3 > 0 and distance < 0,
    )


def _kinds(study: Study) -> Erratum:
    count = Counter(boundary.kind.value for boundary in study.robot.boundaries)
    listed = ", ".join(f"{number} {kind}" for kind, number in sorted(count.items()))
    return Erratum(
        6,
        "Section 3",
        "The robot does not show all four kinds of boundary",
        "all four: consecutive, non-consecutive, branched, coincident branched",
        f"{listed}",
        "Eqs. (8), (9) and (12)-(14) are checked here on a small arm of its own, four_kinds.urdf",
        {kind: float(number) for kind, number in count.items()},
        holds=len(count) < 4,
    )


def _two_names(study: Study) -> Erratum:
    robot = study.robot
    point = robot.annotations.points["o21"]
    places = robot.positions(point.link, robot.home, point.xyz), robot.positions("link_21", robot.home)
    apart = 1e3 * float(np.linalg.norm(places[0] - places[1]))
    return Erratum(
        7,
        "Tables 10, 11",
        "o_21 names both a point of frame 16 and a frame",
        "o_21 in Table 10 is a point of frame 16; in Table 11 it is the frame that carries o_22",
        f"at home the two are {apart:.3f} mm apart",
        "Here the point is o21 and the frame is link_21",
        {"distance at home [mm]": apart},
        holds=apart > 1.0,
    )


def _convexity(study: Study) -> Erratum:
    polygon: Any = study.region.polygon
    missing = float(cast(Any, shapely).convex_hull(polygon).area - polygon.area)
    vertices = study.region.vertices
    into, out = vertices - np.roll(vertices, 1, axis=0), np.roll(vertices, -1, axis=0) - vertices
    turns = np.degrees(np.arctan2(into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0], np.sum(into * out, axis=1)))
    return Erratum(
        8,
        "Fig. 8",
        "The region is convex",
        "the text calls it non-convex and nonlinear",
        f"all {len(turns)} edges are straight, the contour turns left by {turns.min():.1f} to {turns.max():.1f} "
        f"degrees at every vertex, and the convex hull adds {abs(missing):.1e} rad^2",
        "Six half-planes describe it; its image in the workspace is what is curved",
        {"convex hull less region [rad^2]": missing, "smallest turn [deg]": float(turns.min())},
        holds=bool(np.all(turns > 0)) and missing < 1e-12,
    )


def _third_line(study: Study) -> Erratum:
    upper = float(study.robot.upper[study.robot.coordinates.index("q1")])
    beyond = upper + np.radians(10.0)
    printed, meant = (
        float(np.degrees(axis_membership(beyond, -upper, upper, printed=as_printed))) for as_printed in (True, False)
    )
    mu, mu_printed = study.path.membership.mu, study.path.membership.mu_printed
    hidden = int(np.sum(np.any((mu < 0.0) & (mu_printed > 0.0), axis=1)))
    return Erratum(
        9,
        "Eq. (21)",
        "The third line has the wrong sign: beyond the upper limit mu is positive",
        f"q1 ten degrees beyond its upper limit gives mu_1 = {printed:+.3f} degrees: inside, says the text",
        f"q_max - q gives {meant:+.3f} degrees, negative as the text asks",
        f"As printed, violations of an upper limit pass for clearance; on the tool path at {hidden} points. Here mu "
        "uses q_max - q; Fig. 22 shows the print dotted",
        {"mu_1 as printed [deg]": printed, "mu_1 as meant [deg]": meant, "points of the tool path": float(hidden)},
        holds=printed > 0 > meant,
    )


def _differentiable(study: Study) -> Erratum:
    index = study.robot.coordinates.index("q2")
    found = study.path.membership
    low, high = float(found.lower[index]), float(found.upper[index])
    middle, step = (low + high) / 2, 1e-3
    below, at, above = axis_membership([middle - step, middle, middle + step], low, high)
    slopes = float((at - below) / step), float((above - at) / step)
    return Erratum(
        10,
        "Eq. (21)",
        "mu is not differentiable inside the interval: it has a kink in the middle",
        "the text calls mu continuous and differentiable within the interior",
        f"at the middle of q2, {np.degrees(middle):.3f} degrees, the slope jumps from {slopes[0]:+.3f} to "
        f"{slopes[1]:+.3f}",
        "Continuous, yes. Whoever needs gradients takes those of the norms, which are smooth away from contact",
        {"slope below": slopes[0], "slope above": slopes[1]},
        holds=slopes[0] > 0 > slopes[1],
    )
