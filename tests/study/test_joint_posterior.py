"""``[joint.<name>] posterior``: draws of another study or program as the inputs of the next one."""

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.charts.measured_values import measurement_charts, posterior_charts
from uqpen.core.errors import StudyError
from uqpen.report.page import report_page
from uqpen.results.archive_view import select_view
from uqpen.study.load import parse_study

STUDY = """seed = 1
[model]
python = "sum.py:add"
inputs = { a = "m", b = "m", c = "m" }
outputs = { y = "m" }
[inputs]
c = "1 m"
[joint.taught]
posterior = "chains.nc"
units = { a = "cm" }
[designs.mc]
kind = "monte-carlo"
runs = 50
"""


@pytest.fixture
def chains(tmp_path):
    """Draws in the form of ArviZ: two chains of three, and a vector that no input is."""
    (tmp_path / "sum.py").write_text("def add(a, b, c):\n    return {'y': a + b + c}\n")
    draws = {
        "a": (("chain", "draw"), np.array([[1.0, 2, 3], [4, 5, 6]])),
        "b": (("chain", "draw"), np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]), {"units": "m"}),
        "vector": (("chain", "draw", "place"), np.zeros((2, 3, 4))),
    }
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset(draws), "log_likelihood": xr.Dataset()})
    tree.to_netcdf(tmp_path / "chains.nc")
    return tmp_path


def refused(folder, text):
    with pytest.raises(StudyError) as caught:
        parse_study(text, folder=folder)
    return [str(each) for each in caught.value.problems]


def test_draws_of_another_program_are_rows_chain_by_chain(chains):
    (group,) = parse_study(STUDY, folder=chains).joint.groups
    assert group.inputs == ("a", "b")
    exact = [[0.01, 0.1], [0.02, 0.2], [0.03, 0.3], [0.04, 0.4], [0.05, 0.5], [0.06, 0.6]]
    assert group.rows.tolist() == exact
    assert not group.taught_by


def test_one_of_its_variables_may_be_taken_alone(chains):
    text = STUDY.replace('units = { a = "cm" }', 'inputs = ["b"]').replace(
        'c = "1 m"', 'c = "1 m"\na = "1 m"'
    )
    (group,) = parse_study(text, folder=chains).joint.groups
    assert group.rows.ravel().tolist() == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('units = { a = "cm" }', "", 'nc", column "a" is without a unit; expected a length'),
        ("chains.nc", "chain.nc", "found there is no file"),
        ("chains.nc", "chains.nc:fit", "is a NetCDF file, but not an archive of uqpen's"),
        ("chains.nc", "sum.py", "cannot be read as NetCDF"),
        ('units = { a = "cm" }', 'units = { a = "cm" }\ninputs = ["a", "vector"]',
         '"vector" is no input'),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_what_is_expected(chains, old, new, message):
    (found,) = [each for each in refused(chains, STUDY.replace(old, new)) if "joint.taught" in each]
    assert message in found
    assert "expected an archive and its design" in found


TAUGHT = """seed = 1
[model]
python = "sum.py:add"
inputs = { a = "m", b = "m", c = "m" }
outputs = { y = "m" }
[inputs]
a = "(1 ± 1) m"
b = "(2 ± 1) m"
c = "1 m"
[measured.rows]
conditions = ["c"]
unknown = ["a", "b"]
table = { "c [m]" = [1, 2, 3], "y [m]" = [4.1, 5.0, 5.8] }
y = { std = "0.1 m" }
[designs.fit]
kind = "posterior"
measured = ["rows"]
particles = 100
"""


def next_study(sampled):
    """Return a study whose inputs a and b are the draws of an archive's design."""
    start, end = TAUGHT.index("[inputs]"), TAUGHT.index("[measured")
    joint = f'[inputs]\nc = "1 m"\n[joint.taught]\nposterior = "{sampled}"\n'
    design = '[designs.next]\nkind = "monte-carlo"\nruns = 60\nat = "rows"\n'
    return TAUGHT[:start] + joint + TAUGHT[end : TAUGHT.index("[designs")] + design


def test_the_next_study_has_the_draws_to_the_bit_and_knows_what_has_taught_them(chains):
    uqpen.make_archive(parse_study(TAUGHT, folder=chains), chains / "taught.nc")
    draws = uqpen.open_archive(chains / "taught.nc")["calibrations/fit/posterior"].to_dataset()
    text = next_study("taught.nc:fit")
    # A row of the fit, and one that is new.
    text = text.replace("[1, 2, 3]", "[3, 4]").replace("[4.1, 5.0, 5.8]", "[5.8, 7.0]")
    text += '[validation.rows]\naccept = { y = "10 m" }\n'
    study = parse_study(text, folder=chains)
    (group,) = study.joint.groups
    assert group.inputs == ("a", "b")
    assert (group.rows == np.column_stack([draws[name].values.ravel() for name in "ab"])).all()
    found = uqpen.run(study)["validation/next/y"]
    assert found["used_before"].values.tolist() == [1, 0]
    assert found["row_verdict"].values.tolist() == ["not decided", "met"]
    # What the fit knows of the sum is in the predictions, and no more.
    assert found["predicted_std"].values == pytest.approx([0.1 / np.sqrt(3)] * 2, rel=0.4)


SEARCHED = (
    TAUGHT.partition("[designs")[0]
    + """[designs.fit]
kind = "posterior-by-surrogate"
measured = ["rows"]
runs = 20
batches = 1
batch = 5
confirm = 30
"""
)


def test_draws_of_a_posterior_by_a_surrogate_keep_their_weights(chains):
    uqpen.make_archive(parse_study(SEARCHED, folder=chains), chains / "taught.nc")
    kept = uqpen.open_archive(chains / "taught.nc")["calibrations/fit"]
    draws = kept["weighted_posterior"].to_dataset()
    (group,) = parse_study(next_study("taught.nc:fit"), folder=chains).joint.groups
    assert (group.rows == np.column_stack([draws[name].values.ravel() for name in "ab"])).all()
    assert (group.weights == draws["importance_weight"].values.ravel()).all()
    assert group.taught_by == {*kept["row_hash"].values.tolist()}
    found, *_ = refused(chains, next_study("taught.nc:other"))
    assert 'has no group "calibrations/other/posterior"' in found


def test_draws_that_the_model_does_not_confirm_are_refused(chains):
    (chains / "sum.py").write_text(
        "def add(a, b, c):\n    return {'y': a + b * c + 5 * ((1e6 * a) % 1)}\n"
    )
    uqpen.make_archive(parse_study(SEARCHED, folder=chains), chains / "taught.nc")
    found, *_ = refused(chains, next_study("taught.nc:fit"))
    assert "the model does not confirm the posterior fit; expected an archive" in found


def test_the_page_has_draws_of_the_prior_and_the_posterior(chains):
    tree = uqpen.run(parse_study(TAUGHT, folder=chains))
    view = select_view(tree, None, None, None)
    (charts,) = posterior_charts(view)
    assert [each.title for each in charts.charts] == ["a", "b", "b against a"]
    bars, prior = charts.charts[0].marks
    assert np.sum(bars.counts) == pytest.approx(1)
    assert np.sum(prior.y[:-1]) == pytest.approx(1)
    (of_rows,) = measurement_charts(view)
    assert of_rows.charts[0].source == "fit"
    assert "prior and posterior by fit" in report_page(tree)


def test_the_page_has_an_unknown_size_of_errors_in_the_unit_of_its_output(chains):
    text = TAUGHT.replace('"0.1 m"', '{ half-normal = "0.5 m" }').replace('"a", "b"', '"a"')
    text = text.replace("unknown =", 'fixed = ["b"]\nunknown =')
    tree = uqpen.run(parse_study(f'{text}[outputs.y]\nunit = "cm"\n', folder=chains))
    (charts,) = posterior_charts(select_view(tree, None, None, None))
    titles = [each.x.title for each in charts.charts]
    assert titles[:2] == ["a [m]", "std of y [cm]"]
    edges = charts.charts[1].marks[0].edges
    exact = tree["calibrations/fit/posterior/std of y"].values
    assert edges[-1] >= 100 * exact.max()
    assert "std of y" in report_page(tree)
