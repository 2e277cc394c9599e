"""Reading motions, and their histories, against the boundaries and the region; every bad file gets one clear error."""

from pathlib import Path

import numpy as np
import pytest

import pinbound as pb

HEAD = "time,q1,q2,q3\n"


@pytest.fixture(scope="module")
def robot() -> pb.Robot:
    return pb.load("minervabot_v3")


def test_csv_npz_and_parquet_say_the_same(robot: pb.Robot, tmp_path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    times, Q = np.array([0.0, 0.5, 2.0]), np.array([[0.0, 0.1, 0.2], [0.3, 0.4, 0.5], [-0.1, 0.6, 0.25]])
    columns = {"q3": Q[:, 2], "time": times, "q1": Q[:, 0], "q2": Q[:, 1]}
    rows = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "m.csv").write_text("# recorded\n" + "\n".join(rows) + "\n")
    np.savez(tmp_path / "m.npz", **columns)
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "m.parquet")
    for suffix in ("csv", "npz", "parquet"):
        motion = pb.read_motion(robot, tmp_path / f"m.{suffix}")
        np.testing.assert_array_equal(motion.waypoints, Q)
        np.testing.assert_array_equal(motion.times, times)


def test_degrees_time_and_followers(robot: pb.Robot, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text("q1,q2,q3,q2_level\n10,20,30,-20\n11,21,31,-21\n")
    motion = pb.read_motion(robot, path, deg=True)
    assert motion.times is None
    np.testing.assert_allclose(motion.waypoints, np.radians([[10, 20, 30], [11, 21, 31]]))
    path.write_text("q1,q2,q3,q2_level\n10,20,30,-20\n11,21,31,21\n")
    with pytest.raises(pb.InputError, match=r"line 3.*does not follow"):
        pb.read_motion(robot, path, deg=True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("# only a comment\n", "empty"),
        (HEAD, "no row"),
        ("time,q1,q2\n0,0,0\n", "no column for q3"),
        (HEAD.replace("q3", "q4") + "0,0,0,0\n", "did you mean 'q3'|column 'q4'"),
        ("time,q1,q2,q3,q3\n0,0,0,0,0\n", "twice"),
        ("time;q1;q2;q3\n0;0;0;0\n", "commas"),
        (HEAD + "0,0,0\n", "line 2: 3 cells for 4 columns"),
        (HEAD + "0,0,0,x\n", "line 2: q3 is 'x'"),
        (HEAD + "0,0,,0\n", "q2 in row 1 is empty or nan"),
        (HEAD + "0,0,0,nan\n", "line 2: q3 in row 1 is empty or nan"),
        (HEAD + "0,0,0,0\n1,inf,0,0\n", "line 3: q1 in row 2 is inf"),
        (HEAD + "0,0,0,0\n2,0,0,0\n1,0,0,0\n", "line 4: time does not increase"),
        (HEAD + "0,0,0,0\n0,0,0,0\n", "does not increase"),
        ('time,q1,q2,q3\n0,0,0,"0\n', "no CSV"),
        ("\x00\x01\x02", "column|empty|CSV"),
    ],
)
def test_bad_csv(robot: pb.Robot, tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "motion.csv"
    path.write_text(text)
    with pytest.raises(pb.InputError, match=message) as raised:
        pb.read_motion(robot, path)
    assert "motion.csv" in str(raised.value)


def test_several_faults_at_once(robot: pb.Robot, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text(HEAD + "0,a,0,0\n1,0,b,0\n")
    with pytest.raises(pb.InputError, match="2 problems"):
        pb.read_motion(robot, path)


def test_bad_binaries(robot: pb.Robot, tmp_path: Path) -> None:
    cases = {
        "broken.npz": b"PK not a zip",
        "broken.parquet": b"PAR1 nothing",
        "latin.csv": b"q1,q2\xe9\n",
        "m.txt": b"1",
    }
    for name, content in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(pb.InputError, match=name):
            pb.read_motion(robot, tmp_path / name)
    np.savez(tmp_path / "words.npz", q1=["a"], q2=[1.0], q3=[1.0])
    with pytest.raises(pb.InputError, match="'q1'"):
        pb.read_motion(robot, tmp_path / "words.npz")
    np.savez(tmp_path / "ragged.npz", q1=[1.0], q2=[1.0, 2.0], q3=[1.0])
    with pytest.raises(pb.InputError, match="different lengths"):
        pb.read_motion(robot, tmp_path / "ragged.npz")
    np.save(tmp_path / "one.npz", np.zeros(3))
    (tmp_path / "one.npz.npy").rename(tmp_path / "one.npz")
    with pytest.raises(pb.InputError, match="one array"):
        pb.read_motion(robot, tmp_path / "one.npz")
    with pytest.raises(FileNotFoundError):
        pb.read_motion(robot, tmp_path / "absent.csv")


def test_history_agrees_with_boundaries_and_region(robot: pb.Robot) -> None:
    region = pb.feasible_region(robot).scale(0.9)
    waypoints = np.radians([[0, 0, 0], [90, 40, 60], [100, 0, 60], [-20, 60, 20]])
    seen = pb.history(robot, waypoints, [0.0, 1.0, 4.0, 5.0], region)
    assert (seen.times[0], seen.times[-1], len(seen.times)) == (0.0, 5.0, 1000)
    np.testing.assert_array_equal(seen.Q[-1], waypoints[-1])
    misses = np.array([boundary.contact.smallest for boundary in robot.boundaries])  # all ten are stops
    norms = robot.boundaries.norms(seen.Q)
    np.testing.assert_allclose(seen.clearances**2, norms**2 - misses**2, atol=1e-15)
    whole = pb.feasible_region(robot)
    np.testing.assert_array_equal(np.all(seen.clearances > 0, axis=1), whole.contains(seen.Q))
    np.testing.assert_array_equal(seen.places == pb.Place.INSIDE, region.contains(seen.Q))
    assert set(seen.places) == {pb.Place.INSIDE, pb.Place.OUTSIDE}
    ends = region.vertices[:, 0].min(), region.vertices[:, 0].max()
    q2 = seen.Q[:, 1]
    inside = (q2 >= ends[0]) & (q2 <= ends[1])
    np.testing.assert_allclose(seen.mu[inside, 1], np.minimum(q2 - ends[0], ends[1] - q2)[inside])
    assert np.all(seen.mu[~inside, 1] < 0.0)
    assert np.all(seen.mu[:, 1:].min(axis=1) >= seen.signed_distance - 1e-12)


def test_place_on_the_contour(robot: pb.Robot) -> None:
    region = pb.feasible_region(robot)
    on = np.array([0.0, *(0.5 * (region.edges[1].start + region.edges[1].end))])
    assert pb.history(robot, on, region=region, samples=1).places.tolist() == [pb.Place.ON]


def test_figure_shows_every_boundary(robot: pb.Robot, tmp_path: Path) -> None:
    from pinbound.figures.motion_figure import draw_motion

    waypoints = np.radians([[0, 0, 0], [0, 0, 60]])
    seen = pb.history(robot, waypoints, region=pb.feasible_region(robot))
    figure = draw_motion(seen, pb.certify(robot, waypoints))
    figure.savefig(tmp_path / "m.png")
    assert [axes.get_ylabel() for axes in figure.axes] == ["signed clearance [mm]", "inside by [deg]"]
    assert len(figure.axes[0].lines) >= len(robot.boundaries)
    assert "violated" in figure.axes[0].get_title(loc="left")
