"""Statistics that a study leaves out."""

import numpy as np
import pytest

import uqpen
from uqpen.core.errors import StudyError
from uqpen.report.page import report_page
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.verify import verify

LEFT_OUT = {"sensitivity": False, "convergence": False}


def sums(a, b):
    return {"y": np.exp(a) + b, "curve": np.exp(a)[:, None] * np.arange(1.0, 4.0)}


def study(**left_out):
    curve = uqpen.OutputSpec("1", along={"place": {"unit": "m", "values": [1, 2, 3]}})
    return uqpen.Study(
        model=uqpen.PythonModel(
            sums, inputs={"a": "1", "b": "1"}, outputs={"y": "1", "curve": curve}, vectorized=True
        ),
        inputs={"a": uqpen.Normal(0, 0.3), "b": uqpen.Uniform(0, 1)},
        outputs={"y": uqpen.OutputSpec(exceeds=["2"], hold=[0.9])},
        designs={
            "mc": uqpen.MonteCarlo(runs=128),
            "pick_freeze": uqpen.Saltelli(base=32),
            "training": uqpen.LatinHypercube(runs=64, replicates=1),
        },
        surrogates={"chaos": uqpen.PolynomialChaos(design="training")},
        seed=1,
        **left_out,
    )


@pytest.fixture(scope="module")
def whole():
    return uqpen.run(study())


@pytest.fixture(scope="module")
def shorter():
    return uqpen.run(study(**LEFT_OUT))


def statistics(tree):
    return {node.path: node.to_dataset() for node in tree["statistics"].subtree if node.level == 3}


def test_nothing_else_changes(whole, shorter):
    assert statistics(whole).keys() == statistics(shorter).keys()
    for path, found in statistics(shorter).items():
        assert found.data_vars
        for name, array in found.data_vars.items():
            np.testing.assert_array_equal(array.values, statistics(whole)[path][name].values)


def test_no_index_and_no_growing_part_is_estimated(whole, shorter):
    gone = {
        name
        for path, found in statistics(whole).items()
        for name in set(found.data_vars).difference(statistics(shorter)[path].data_vars)
    }
    assert {"first_order", "total_order", "spearman", "delta"} <= gone
    assert not {"mean", "std", "quantile", "exceedance", "cdf"} & gone
    assert not any(
        "convergence" in name for found in statistics(shorter).values() for name in found
    )


def test_the_page_says_what_is_left_out(whole, shorter):
    said = "without sensitivity, convergence, as the study says"
    assert said in report_page(shorter)
    assert said not in report_page(whole)


def test_verification_leaves_the_same_out(tmp_path):
    path = tmp_path / "study.nc"
    alone = {"designs": {"mc": uqpen.MonteCarlo(runs=128)}, "surrogates": None}
    uqpen.make_archive(study(**LEFT_OUT).replace(**alone), path)
    verdicts = {each.name: each.verdict for each in verify(path, objects={("model",): sums})}
    assert verdicts["statistics"] is CheckOutcome.EQUAL


def test_other_values_are_refused():
    with pytest.raises(StudyError, match=r'sensitivity[\s\S]*"no"[\s\S]*true or false'):
        study(sensitivity="no")
