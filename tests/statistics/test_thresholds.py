"""Probabilities of exceeding a value and of lying below it."""

import numpy as np
import pytest
from drawn_samples import runs_of_values
from scipy import special

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.core.model import Output
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import output_tables
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold

LENGTH = Output("y", "m")


def below(values, *thresholds, **of_runs):
    asked = tuple(Threshold(f"{value:g} m", value) for value in thresholds)
    quantity = QuantityOfInterest(LENGTH, "m", lower_thresholds=asked)
    return analyze(runs_of_values(values, **of_runs), [quantity], only=["exceedance"])["y"]["below"]  # type: ignore[arg-type]


def exceedance(values, *thresholds, **of_runs):
    asked = tuple(Threshold(f"{value:g} m", value) for value in thresholds)
    quantity = QuantityOfInterest(LENGTH, "m", thresholds=asked)
    found = analyze(runs_of_values(values, **of_runs), [quantity], only=["exceedance"])  # type: ignore[arg-type]
    return found["y"]["exceedance"]


class TestBelow:
    def test_the_interval_is_the_exact_binomial_one(self):
        found = below(np.arange(20.0), 3.0)
        # 0, 1 and 2 lie below 3; the quantiles are those of Beta(3, 18) and Beta(4, 17).
        ends = special.betaincinv(3, 18, 0.025), special.betaincinv(4, 17, 0.975)
        assert found.values[0] == pytest.approx([3 / 20, *ends], abs=1e-12)
        assert found["lower_threshold_value"].values.tolist() == [3.0]
        assert found["lower_threshold"].values.tolist() == ["3 m"]

    def test_no_run_below_leaves_an_upper_bound_alone(self):
        # 1 - 0.025^(1/20): the exact bound for no event in 20 runs.
        assert below(np.arange(20.0), 0.0).values[0] == pytest.approx(
            [0, 0, 1 - 0.025 ** (1 / 20)], abs=1e-12
        )

    @pytest.mark.parametrize(
        "of_runs",
        [{}, {"sampling": "stratified", "replicates": 8}, {"sampling": "stratified"}],
        ids=["independent", "replicated", "single set"],
    )
    def test_it_is_the_exceedance_of_the_mirrored_output(self, of_runs):
        values = np.random.default_rng(5).gumbel(size=320)
        values[::40] = np.nan
        one = below(values, -1.0, 0.3, 2.0, **of_runs)
        other = exceedance(-values, 1.0, -0.3, -2.0, **of_runs)
        np.testing.assert_array_equal(one.values, other.values)
        assert one["note"].values.tolist() == other["note"].values.tolist()
        assert one["interval_label"].values.tolist() == other["interval_label"].values.tolist()

    def test_failed_runs_count_both_ways(self):
        values = np.arange(20.0)
        values[5:10] = np.nan
        found = below(values, 3.0).values[0]
        lowest, highest = special.betaincinv(3, 18, 0.025), special.betaincinv(9, 12, 0.975)
        assert found == pytest.approx([3 / 15, lowest, highest], abs=1e-12)

    def test_a_value_at_the_threshold_is_on_neither_side(self):
        values = np.repeat([1.0, 2.0, 3.0], 10)
        both = [below(values, 2.0).values[0, 0], exceedance(values, 2.0).values[0, 0]]
        assert both == pytest.approx([1 / 3, 1 / 3])


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    def function(a, b):
        return {"y": a + 2 * b}

    study = uqpen.Study(
        function,
        {"a": uqpen.Uniform("0 m", "1 m"), "b": uqpen.Uniform("0 m", "1 m")},
        {"y": uqpen.OutputSpec("m", exceeds=["2 m"], below=["72 cm", "2 m"])},
        {"mc": uqpen.MonteCarlo(runs=200), "lhs": uqpen.LatinHypercube(runs=100)},
        surrogates={"pce": uqpen.PolynomialChaos(design="lhs")},
        seed=1,
    )
    return uqpen.run(study)


def test_the_archive_has_it_by_every_source(tree):
    assert list(find_faults(tree)) == []
    for source in ("mc", "lhs", "pce"):
        found = tree[f"statistics/{source}/y"]["below"].sel(
            lower_threshold="72 cm", bound="estimate"
        )
        # The area of a triangle with the legs 0.72 and 0.36.
        assert float(found) == pytest.approx(0.72 * 0.36 / 2, abs=0.06)
    history = tree["statistics/mc/y"]["convergence_below"]
    np.testing.assert_array_equal(history[-1], tree["statistics/mc/y"]["below"])


def test_tables_json_and_the_long_table_agree(tree):
    rows = dict(
        next(table for table in output_tables(tree) if "P(< 72 cm)" in dict(table.rows)).rows
    )
    reported = archive_json(tree)["designs"]["mc"]["outputs"]["y"]["below"]["72 cm"]
    assert rows["P(< 72 cm)"][0].startswith(f"{reported['estimate']:.3f}")
    frame = long_table(tree).query("source == 'mc' and statistic == 'below'")
    assert frame["lower_threshold"].tolist() == ["72 cm", "2 m"]
    assert frame["estimate"].iloc[0] == reported["estimate"]


def test_the_page_has_a_sentence_of_it(tree):
    page = str(list(answer(ArchiveView(tree, "")))).replace("\\xa0", " ").replace("\u00a0", " ")
    assert "head='y above 2 m', text='In " in page
    assert "head='y below 72 cm', text='In " in page


def test_the_study_states_it_in_its_text_and_its_summary():
    study = uqpen.Study(
        lambda a: {"y": a},
        {"a": uqpen.Uniform("0 m", "1 m")},
        {"y": uqpen.OutputSpec("m", below=["0.5 m"])},
        {"mc": uqpen.MonteCarlo(runs=20)},
        seed=1,
    )
    assert 'below = [\n    "0.5 m",\n]' in study.to_toml()
    assert "P(&lt; 0.5 m)" in study._repr_html_()
    assert study.quantities_of_interest[0].lower_thresholds == (Threshold("0.5 m", 0.5),)


def test_a_wrong_threshold_is_refused_with_its_place(study_of):
    with pytest.raises(uqpen.StudyError) as caught:
        study_of("a", '[outputs.y]\nbelow = [0.5, "2 kg"]', a=(0, 1))
    assert "outputs.y.below[1]" in str(caught.value)
    assert '"2 kg"' in str(caught.value)
