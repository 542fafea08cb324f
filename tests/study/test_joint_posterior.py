"""``[joint.<name>] posterior``: draws of another study or program as the inputs of the next one."""

import numpy as np
import pytest
import xarray as xr

from uqpen.core.errors import StudyError
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
        ('units = { a = "cm" }', "", 'column "a" is in "1"; expected a length'),
        ("chains.nc", "chain.nc", "found there is no file"),
        ("chains.nc", "chains.nc:fit", 'has no group "calibrations/fit/posterior"'),
        ("chains.nc", "sum.py", "cannot be read as NetCDF"),
        (
            'units = { a = "cm" }',
            'units = { a = "cm" }\ninputs = ["a", "vector"]',
            '"vector" is no input',
        ),
    ],
)
def test_a_mistake_is_told_with_what_is_expected(chains, old, new, message):
    (found,) = [each for each in refused(chains, STUDY.replace(old, new)) if "joint.taught" in each]
    assert message in found
    assert "expected an archive and its design" in found
