"""Shares of model form: exact answers of models whose variances are known, and refusals."""

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.core.model import Output
from uqpen.report.sections.answer import model_form_texts
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics.model_form import model_form_shares
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

STUDY = """
seed = 5
sensitivity = false
convergence = false
[models.first]
python = "models.py:first"
vectorized = true
inputs = {{ x = "1", z = "1" }}
outputs = {{ y = "m" }}
[models.second]
python = "models.py:second"
vectorized = true
inputs = {{ x = "1", z = "1" }}
outputs = {{ y = "m" }}
[inputs]
x = {{ uniform = {{ lower = 0, upper = 1 }} }}
z = {{ uniform = {{ lower = 0, upper = 1 }} }}
[outputs.y]
exceeds = ["1 m", "9 m"]
[designs.sample]
{design}
[designs.rule]
kind = "quadrature"
order = 2
"""
MONTE_CARLO = 'kind = "monte-carlo"\nruns = 4000'
HYPERCUBE = 'kind = "latin-hypercube"\nruns = 4000'
SOBOL_SEQUENCES = 'kind = "sobol-sequence"\nruns = 256\nreplicates = 16'
SHARES = ("model_form_share", "parameter_share", "interaction_share")


def of_models(folder, first, second, design=MONTE_CARLO, study=STUDY):
    """The archive of two models, each a line of NumPy in x and z."""
    source = "import numpy as np\n"
    for name, line in (("first", first), ("second", second)):
        source += f"def {name}(x, z):\n    return {{'y': {line}}}\n"
    (folder / "models.py").write_text(source)
    return uqpen.run(uqpen.parse_study(study.format(design=design), folder=folder))


def shares(tree):
    group = tree["model_form/sample/y"]
    return np.array([group[name].values for name in SHARES])


@pytest.mark.parametrize(
    ("design", "first", "second", "exact"),
    [
        # A shift by 1: Var E[y|M] = 1/4, Var E[y|X] = 1/12.
        (MONTE_CARLO, "x", "x + 1", (3 / 4, 1 / 4, 0.0)),
        # Opposite slopes: the mean over models does not depend on x.
        (HYPERCUBE, "x", "1 - x", (0.0, 0.0, 1.0)),
        # Different inputs: half of each variance is common.
        (MONTE_CARLO, "x", "z", (0.0, 1 / 2, 1 / 2)),
        (SOBOL_SEQUENCES, "x", "z", (0.0, 1 / 2, 1 / 2)),
        # Var E[y|M] = (1/2)² / 4 = 1/16; E[y|X] = 3x/2; Var y = 1/16 + (1/12 + 4/12)/2 = 13/48.
        (HYPERCUBE, "x", "2 * x", (3 / 13, 9 / 13, 1 / 13)),
        (SOBOL_SEQUENCES, "x", "2 * x", (3 / 13, 9 / 13, 1 / 13)),
    ],
)
def test_shares_are_those_of_an_analysis_of_variance(tmp_path, design, first, second, exact):
    found = shares(of_models(tmp_path, first, second, design))
    assert found[:, 0] == pytest.approx(exact, abs=0.03)  # about four errors of 4 000 draws
    assert found[:, 0].sum() == pytest.approx(1.0, abs=1e-12)
    margin = 1e-9 + 0.5 * (found[:, 2] - found[:, 1])  # half as wide again: 4 of 5 designs' seeds
    assert (found[:, 1] - margin <= exact).all()
    assert (exact <= found[:, 2] + margin).all()


def test_an_event_has_shares_of_its_own(tmp_path):
    # P(y > 1) is 0 and 1 by the two: all of the variance of the event is model form.
    tree = of_models(tmp_path, "x", "x + 1")
    statistics = SourceStatistics.of_model_form(tree)
    event = statistics.get("sample", "y", "exceedance_model_form_share")
    assert event is not None
    assert event["threshold"].values.tolist() == ["1 m", "9 m"]
    assert event.values[0, 0] == pytest.approx(1.0, abs=1e-12)
    # No run has shown the event in neither or in both, so its error is not known.
    assert np.isnan(event.values[0, 1:]).all()
    assert np.isnan(event.values[1]).all()
    assert event["note"].values.tolist() == [
        "fewer than ten runs lie on one side",
        "the event occurs in all runs or in none",
    ]


def test_a_page_says_it_of_events_with_a_limit_that_occur(tmp_path):
    limits = '{{ "0.5 m" = {{ at_most = "5 %" }}, "1 m" = {{}}, "9 m" = {{ at_most = "5 %" }} }}'
    study = STUDY.replace('["1 m", "9 m"]', limits)
    tree = of_models(tmp_path, "x", "2 * x", study=study)
    of_output, of_event = model_form_texts(ArchiveView(tree, "first"), ["y"], "sample")
    assert of_output.startswith("Of the variance of y, 22.79\u00a0% (")
    assert of_event.startswith("Of whether it is above 0.5\u00a0m, ")


def test_only_runs_that_all_models_completed_count(tmp_path):
    tree = of_models(tmp_path, "x", "np.where(x > 0.5, np.nan, x + 1)")
    share = tree["model_form/sample/y"]["model_form_share"]
    failed = int((tree["models/first/runs/sample"]["x"] > 0.5).sum())
    assert share.attrs["runs_used"] == 4000 - failed
    assert "missing" in share.attrs
    # Of x below one half: Var = (1/2)² / 12.
    assert share.values[0] == pytest.approx((1 / 4) / (1 / 4 + 1 / 48), abs=0.01)


def test_a_stand_in_is_no_model_of_its_own(tmp_path):
    stand_in = '[models.second]\nstands_for = "first"\ncost = 0.1'
    study = STUDY.replace("[models.second]", stand_in)
    tree = of_models(tmp_path, "x", "x + 1", study=study)
    assert "model_form" not in tree.children


def test_a_design_that_is_no_sample_has_none(tmp_path):
    assert list(of_models(tmp_path, "x", "x + 1")["model_form"].children) == ["sample"]


def test_models_that_agree_in_everything_have_a_share_of_zero(tmp_path):
    found = shares(of_models(tmp_path, "x", "x"))
    assert found[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert found[1] == pytest.approx([1.0, 1.0, 1.0], abs=1e-12)


def test_the_share_of_form_of_few_runs_is_unbiased():
    """The models' means differ by chance alone, which is no form of theirs."""
    rng, found = np.random.default_rng(1), []
    quantities = [QuantityOfInterest(Output("y", "m"), "m")]
    for _ in range(100):
        x, z = rng.normal(size=(2, 10))
        runs = {
            name: xr.Dataset({"y": ("run", y), "status": ("run", np.zeros(10, np.int8))})
            .assign_coords(run=np.arange(10))
            .assign_attrs(sampling="independent")
            for name, y in (("first", x + z), ("second", x - z))
        }
        found.append(float(model_form_shares(runs, quantities)["y"]["model_form_share"][0]))
    # Without the correction it is 0.05, and the error of the mean is about 0.007.
    assert np.mean(found) == pytest.approx(0.0, abs=0.025)
