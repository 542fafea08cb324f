"""Charts of one run at the nominal inputs."""

import numpy as np
import pytest

from uqpen.charts.marks import Line
from uqpen.charts.trajectory import axial_velocity, trajectory_charts, velocity_profile_chart
from uqpen.results.archive_view import ArchiveView


@pytest.mark.parametrize("smoothing", [0.0, 0.5, 1.0])
def test_a_velocity_profile_is_v_then_u_then_nothing(smoothing):
    u, v, s, R, S = 900.0, 1300.0, 0.003, 0.017, 0.1
    places, velocities = axial_velocity((u, v), s, (R, S, smoothing))
    at = dict(zip(places.round(12).tolist(), velocities.tolist(), strict=True))
    assert at[-s] == pytest.approx(v)
    assert at[0.0] == pytest.approx(u)
    assert at[round(S - R, 12)] == pytest.approx(0, abs=1e-9)
    assert (np.diff(velocities) <= 1e-9).all()


def test_a_velocity_profile_begins_at_the_velocity_of_the_tail(archives):
    tree = archives["rods"]
    (chart,) = velocity_profile_chart(ArchiveView(tree, "smoothed"))
    lines = [mark for mark in chart.marks if isinstance(mark, Line)]
    assert [key.text for key in chart.keys] == [line.name for line in lines]
    course = tree["models/smoothed/trajectory"]
    depths = 1e3 * course["penetration_depth"].values
    for line in lines:
        at = np.abs(depths - float(line.name.split()[-2])).argmin()
        assert line.y[0] == pytest.approx(course["tail_velocity"].values[at], rel=0.01)
        assert line.y[-1] == 0
    assert chart.notes == ("At the nominal inputs.",)


def test_a_rigid_rod_has_no_velocity_profile(archives):
    assert not list(velocity_profile_chart(ArchiveView(archives["rods"], "rigid")))


def test_a_page_has_some_points_and_a_figure_all(archives):
    view = ArchiveView(archives["rods"], "original")
    (every,), (some,) = trajectory_charts(view), trajectory_charts(view, 10)
    (whole, thinned) = (each.charts[0].marks[0] for each in (every, some))
    assert isinstance(whole, Line)
    assert isinstance(thinned, Line)
    course = archives["rods"]["models/original/trajectory"]
    assert len(whole.x) == course.sizes["penetration_depth"]
    assert len(thinned.x) == 10
    assert {thinned.x[0], thinned.x[-1]} == {whole.x[0], whole.x[-1]}
