"""FORM and SORM: design points of planes and paraboloids, what is not known, mistakes."""

import math

import numpy as np
import pytest
import xarray as xr
from rare_event_studies import probability
from scipy import special

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.designs.rare_events.form import curvature_offsets, principal_curvatures, tangent_basis
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.joint_probabilities import disagreements
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.statistics.rare_events.form_probability import design_points
from uqpen.statistics.rare_events.rare_event_probability import rare_event

NORMAL = uqpen.Normal(0.0, 1.0)
INPUTS = {"a": NORMAL, "b": NORMAL, "c": NORMAL}


def study(function, event, *, inputs=INPUTS, **settings):
    model = uqpen.PythonModel(
        function, {"a": "1", "b": "1", "c": "1"}, {"depth": "m"}, vectorized=True
    )
    designs = {"rare": uqpen.Form(event=event, **settings)}
    return uqpen.Study(model, inputs, designs=designs, seed=1)


def points_of(tree):
    runs = tree["runs/rare"].to_dataset()
    rare = rare_event(runs)
    assert rare is not None
    return design_points(runs, rare.event, rare.event.outcomes(runs))


def plane(a, b, c):
    """A plane at the distance 4 from the median, across (3, 4, 0)."""
    return {"depth": 0.6 * a + 0.8 * b + 0 * c}


def paraboloid(a, b, c):
    """A limit at a = 4 that bends away from the median along b and c."""
    return {"depth": a - 0.1 * b**2 - 0.05 * c**2}


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study(plane, "depth > 4 m"))


def test_a_plane_is_exact(tree):
    (point,) = points_of(tree)
    # Differences of a plane are exact but for rounding, divided by the step of 0.01.
    assert point.reliability_index == pytest.approx(4, rel=1e-9)
    assert point.direction**2 == pytest.approx([0.36, 0.64, 0], abs=1e-9)
    assert point.curvatures == pytest.approx([0, 0], abs=1e-9)
    assert probability(tree)[0] == pytest.approx(special.ndtr(-4.0), rel=1e-7)


def test_it_has_no_interval_and_says_why(tree):
    found = probability(tree)
    assert np.isnan(found.values[1:]).all()
    note = found.attrs["note"]
    assert "nothing in it measures the error" in note
    assert "a = 2.4 (36 %), b = 3.2 (64 %)" in note
    assert "design point at the reliability index 4" in note
    (entry,) = archive_json(tree)["designs"]["rare"]["joint_probabilities"].values()
    assert "lower" not in entry or entry["lower"] is None
    assert "without an interval" in str(list(answer(ArchiveView(tree, ""))))
    assert not list(find_faults(tree))


def test_design_points_stand_in_archive_json_and_a_table(tree):
    found = tree["joint_probabilities/rare"]
    assert found["reliability_index"].dims == ("design_point", "bound")
    assert found["reliability_index"].values[0, 0] == pytest.approx(4, rel=1e-9)
    assert found["importance_factor"].values[0, :, 0] == pytest.approx([0.36, 0.64, 0], abs=1e-9)
    at = tree["runs/rare"].sel(run=found["design_point_run"].item())
    assert [at[name].item() for name in "abc"] == pytest.approx([2.4, 3.2, 0], abs=1e-7)
    (entry,) = archive_json(tree)["designs"]["rare"]["joint_probabilities"].values()
    (point,) = entry["design_points"]
    assert point["importance_factor"]["b"]["estimate"] == pytest.approx(0.64)
    assert "nothing in it measures the error" in point["reliability_index"]["note"]
    (table,) = (each for each in output_tables(tree) if each.title == "rare: design points")
    rows = {label: cells[0] for label, cells in table.rows}
    assert rows["reliability index"].startswith("4.000")
    assert rows["importance of b"].startswith("0.640")


def test_curvatures_are_those_of_a_paraboloid():
    (point,) = points_of(uqpen.run(study(paraboloid, "depth > 4 m")))
    # The limit is a = 4 + 0.1 b² + 0.05 c². The point is found to within 0.05 of the step.
    assert point.reliability_index == pytest.approx(4, rel=1e-2)
    assert point.curvatures == pytest.approx([0.1, 0.2], rel=5e-2)
    # P(a > 4 + 0.1 b² + 0.05 c²), by Gauss-Hermite integration.
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    b, c = np.meshgrid(nodes, nodes)
    exact = (np.outer(weights, weights) * special.ndtr(-(4 + 0.1 * b**2 + 0.05 * c**2))).sum()
    exact /= 2 * math.pi
    assert point.second_order == pytest.approx(exact, rel=0.1)
    assert point.first_order > 1.4 * exact


def test_second_differences_of_a_quadratic_are_exact():
    gradient = np.array([1.0, -2.0, 2.0])
    basis = tangent_basis(gradient)
    assert basis @ gradient == pytest.approx([0, 0], abs=1e-12)
    assert basis @ basis.T == pytest.approx(np.eye(2), abs=1e-12)
    hessian = np.array([[0.3, 0.1], [0.1, -0.2]])
    offsets = curvature_offsets(3)
    performance = 0.7 - 0.5 * 3 * np.einsum("ni,ij,nj->n", offsets, hessian, offsets)
    found = principal_curvatures(performance, 0.7, gradient)
    assert found == pytest.approx(np.linalg.eigvalsh(hessian), abs=1e-12)


def test_several_design_points_are_united():
    def two(a, b, c):
        return {"depth": np.maximum(a - 3, -b - 3.5) + 0 * c}

    tree = uqpen.run(study(two, "depth > 0 m", starts=9))
    first, second = special.ndtr(-3.0), special.ndtr(-3.5)
    assert len(points_of(tree)) == 2
    # The two are independent, so the common part is their product.
    assert probability(tree)[0] == pytest.approx(first + second - first * second, rel=1e-4)


def test_points_are_in_the_units_of_the_inputs():
    inputs = {"a": uqpen.Normal(10.0, 2.0), "b": uqpen.Uniform(0.0, 1.0), "c": NORMAL}

    def first(a, b, c):
        return {"depth": a + 0 * b + 0 * c}

    tree = uqpen.run(study(first, "depth > 16 m", inputs=inputs))
    assert "a = 16 (100 %), b = 0.5 (0 %)" in probability(tree).attrs["note"]
    assert probability(tree)[0] == pytest.approx(special.ndtr(-3.0), rel=1e-6)


def test_a_common_event_has_a_negative_index():
    tree = uqpen.run(study(plane, "depth > -1 m"))
    assert points_of(tree)[0].reliability_index == pytest.approx(-1, rel=1e-6)
    assert probability(tree)[0] == pytest.approx(special.ndtr(1.0), rel=1e-6)


def test_without_a_design_point_there_is_no_number():
    def steps(a, b, c):
        return {"depth": 1.0 * (a > 4) + 0 * b + 0 * c}

    found = probability(uqpen.run(study(steps, "depth > 0.5 m")))
    assert np.isnan(found.values).all()
    assert "no search has reached a design point" in found.attrs["note"]


def test_failed_runs_are_counted():
    def fails(a, b, c):
        return {"depth": np.where(b > 0.3, np.nan, a + 0 * c)}

    found = probability(uqpen.run(study(fails, "depth > 3 m", starts=9)))
    assert "runs failed, and what lies there is not in it" in found.attrs["note"]


def test_designs_that_disagree_are_named():
    designs = {
        "first_look": uqpen.Form(event="depth > 4 m"),
        "sampled": uqpen.ImportanceSampling(event="depth > 4 m", samples=600),
    }
    model = uqpen.PythonModel(
        paraboloid, {"a": "1", "b": "1", "c": "1"}, {"depth": "m"}, vectorized=True
    )
    tree = uqpen.run(uqpen.Study(model, INPUTS, designs=designs, seed=1))
    expected = "the value of first_look lies outside the interval of sampled"
    table = next(each for each in output_tables(tree) if each.title == "joint probabilities")
    assert expected in str(table.notes)
    assert expected in str(list(answer(ArchiveView(tree, "")))).lower()
    (entry,) = archive_json(tree)["designs"]["sampled"]["joint_probabilities"].values()
    assert entry["disagrees_with"] == ["first_look"]


def test_disjoint_intervals_are_a_disagreement_and_others_are_not():
    def of(*values):
        condition = {"event_condition": ("event", ["y > 1"])}
        return xr.DataArray([values], dims=("event", "bound"), coords=condition)

    near, overlapping, far = of(1.0, 0.9, 1.1), of(1.15, 1.05, 1.3), of(2.0, 1.8, 2.2)
    found = list(disagreements({"a": near, "b": overlapping, "c": far}))
    assert [(each.first, each.second) for each in found] == [("a", "c"), ("b", "c")]
    assert "no mean of them is right" in str(found[0])
    assert not list(disagreements({"a": near, "none": of(math.nan, math.nan, math.nan)}))
