"""What each method says to each kind of input: an exact answer, a note, or the reason why not.

Labels have a file of their own (`test_labels.py`), where the same methods are met.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm, poisson

import uqpen
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics import texts

COUNTS = np.arange(60)
# For each kind: the inputs, the model, a limit; exactly the mean, the variance, P(y > limit) and
# the first-order index of a.
KINDS = {
    "whole numbers": ({"a": "{ poisson = { mean = 3 } }", "b": "10 ± 1"}, "a + b",
                      (15.0, 13.0, 4.0, poisson.pmf(COUNTS, 3) @ norm.sf(15 - COUNTS, 10), 0.75)),
    "derived": ({"a": "1 ± 0.1", "b": "10 ± 0.1", "c": "2 * a"}, "c + b",
                (12.2, 12.0, 0.05, norm.sf(0.2 / 0.05**0.5), 0.8)),
    "conditional": ({"a": "10 ± 1", "b": '{ normal = { mean = "0.1 * a", std = "0.02 * a" } }'},
                    "a + b", (12.0, 11.0, 1.2504, None, 1.21 / 1.2504)),
}  # fmt: skip
# P(a + b > 12) of conditional parameters, by the trapezoidal rule over a, which is exact here.
A = np.linspace(2, 18, 801)
P_CONDITIONAL = 0.02 * (norm.pdf(A, 10, 1) @ norm.sf(12 - A, 0.1 * A, 0.02 * A))


def made(study_of, kind, design):
    inputs, body, (limit, *exact) = KINDS[kind]
    exact[2] = P_CONDITIONAL if exact[2] is None else exact[2]
    text = f"[outputs.y]\nexceeds = [{limit}]\n[designs.d]\nkind = {design}"
    study = study_of(body, text.replace("EVENT", f'event = "y > {limit}"'), **inputs)
    return replace(study, left_out=("convergence",)), exact


def holds(values, exact):
    """See that twice an interval holds an exact value, as some of so many 95 % intervals do not."""
    estimate, lower, upper = np.ravel(values)
    assert 2 * lower - estimate <= exact <= 2 * upper - estimate
    assert lower < upper


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "design",
    [
        '"monte-carlo"\nruns = 1000',
        '"monte-carlo"\nat_most = 4000\nuntil = { y = { mean = "2 %" } }',
        '"latin-hypercube"\nruns = 800',
        '"sobol-sequence"\nruns = 1024',
        '"halton"\nruns = 800',
    ],
)
def test_samples_have_the_exact_mean_probability_and_index(kind, design, study_of):
    study, (mean, variance, probability, index) = made(study_of, kind, design)
    statistics = uqpen.run(study)["statistics/d/y"]
    holds(statistics["mean"], mean)
    holds(statistics["std"], variance**0.5)
    holds(statistics["exceedance"], probability)
    first = statistics["first_order"].sel(input="a", bound="estimate")
    assert float(first) == pytest.approx(index, abs=0.1)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", ["subset-simulation", "importance-sampling"])
def test_rare_event_methods_have_the_exact_probability(kind, method, study_of):
    study, (_, _, probability, _) = made(study_of, kind, f'"{method}"\nEVENT\nsamples = 500')
    holds(uqpen.run(study)["joint_probabilities/d"]["joint_probability"], probability)


@pytest.mark.parametrize("kind", ["whole numbers", "derived"])
def test_blocks_have_the_exact_indices_of_independent_inputs(kind, study_of):
    study, (_, _, _, index) = made(study_of, kind, '"saltelli"\nbase = 512')
    statistics = uqpen.run(study)["statistics/d/y"]
    for name in ("first_order", "total_order"):
        holds(statistics[name].sel(input="a"), index)
        holds(statistics[name].sel(input="b"), 1 - index)


@pytest.mark.parametrize("kind", ["whole numbers", "derived"])
def test_rules_are_exact_for_polynomials(kind, study_of):
    study, (mean, variance, _, _) = made(study_of, kind, '"quadrature"\norder = 2')
    statistics = uqpen.run(study)["statistics/d/y"]
    assert float(statistics["mean"][0]) == pytest.approx(mean)
    assert float(statistics["std"][0]) == pytest.approx(variance**0.5)


def test_a_grid_has_each_of_few_values_once_and_each_label_once(tmp_path):
    (tmp_path / "m.py").write_text("def f(bolt, n, x):\n    return {'y': n * (bolt == 'M8') + x}\n")
    text = (
        'seed = 1\n[model]\npython = "m.py:f"\n[model.labels]\nbolt = ["M8", "M10", "M12"]\n'
        '[model.inputs]\nn = "1"\nx = "1"\n[model.outputs]\ny = "1"\n[inputs]\n'
        "bolt = { choice = { labels = ['M8', 'M12'], weights = [3, 1] } }\n"
        'n = { bernoulli = { probability = 0.25 } }\nx = "0 ± 1"\n'
        '[designs.d]\nkind = "full-factorial"\nlevels = 3'
    )
    study = uqpen.parse_study(text, folder=tmp_path)
    tree = uqpen.run(study)
    runs = tree["runs/d"]
    assert len(runs["y"]) == 12 == study.designs["d"].run_count(study.joint)
    points = {*zip(*(runs[name].values.tolist() for name in ("bolt", "n", "x")), strict=True)}
    assert len(points) == 12
    assert {point[:2] for point in points} == {(0, 0), (0, 1), (2, 0), (2, 1)}
    assert float(tree["statistics/d/y"]["mean"][0]) == pytest.approx(0.75 * 0.25)


@pytest.mark.parametrize(
    ("kind", "design", "reason"),
    [
        ("whole numbers", '"one-at-a-time"', "steps of a, which has single values"),
        ("whole numbers", '"form"\nEVENT', "steps of a, which has single values"),
        ("whole numbers", '"salib:finite_diff"\nN = 4', "steps of a, which has single values"),
        ("conditional", '"one-at-a-time"', "whose own distribution is not known"),
        ("conditional", '"saltelli"\nbase = 64', "parameters of [inputs]"),
        ("conditional", '"morris"\ntrajectories = 4', "parameters of [inputs]"),
        ("conditional", '"quadrature"\norder = 2', "parameters of [inputs]"),
        ("conditional", '"salib:fast_sampler"\nN = 65', "parameters of [inputs]"),
    ],
)
def test_a_method_that_cannot_says_why(kind, design, reason, study_of):
    with pytest.raises(uqpen.StudyError) as caught:
        made(study_of, kind, design)
    assert reason in str(caught.value)


def test_effects_and_design_points_are_those_of_the_sources(study_of):
    study, (_, _, probability, _) = made(study_of, "derived", '"form"\nEVENT')
    event = uqpen.run(study)["joint_probabilities/d"]
    assert float(event["first_order_probability"][0, 0]) == pytest.approx(probability, rel=1e-6)
    factors = event["importance_factor"].sel(bound="estimate").squeeze()
    assert factors["input"].values.tolist() == ["a", "b"]
    assert float(factors.sel(input="a")) == pytest.approx(0.8, abs=1e-6)
    # The deviation of a moves y twice as far as that of b does.
    for design, name in (
        ('"one-at-a-time"', "contribution"),
        ('"morris"\ntrajectories = 8', "mu_star"),
    ):
        study, _ = made(study_of, "derived", design)
        moved = uqpen.run(study)["statistics/d/y"][name].sel(bound="estimate")
        assert float(moved.sel(input="a") / moved.sel(input="b")) == pytest.approx(2)


@pytest.mark.parametrize("kind", ["whole numbers", "derived", "conditional"])
def test_a_learned_event_is_corrected_to_the_exact_probability(kind, study_of):
    study, (_, _, probability, _) = made(study_of, kind, '"active-learning"\nEVENT')
    holds(uqpen.run(study)["joint_probabilities/d"]["joint_probability"], probability)


def test_correlations_of_whole_numbers_have_their_value_and_shared_parts_a_note(study_of):
    study, _ = made(study_of, "whole numbers", '"monte-carlo"\nruns = 1000')
    holds(uqpen.run(study)["statistics/d/y"]["pearson"].sel(input="a"), 0.75**0.5)
    study, _ = made(study_of, "conditional", '"monte-carlo"\nruns = 1000')
    statistics = uqpen.run(study)["statistics/d/y"]
    assert statistics["first_order"].attrs["note"] == texts.INCLUDES_CORRELATION


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("kind_of_surrogate", ["polynomial-chaos", "gaussian-process"])
def test_surrogates_have_the_exact_numbers_or_say_why_not(kind, kind_of_surrogate, study_of):
    design = f'"monte-carlo"\nruns = 80\n[surrogates.s]\nkind = "{kind_of_surrogate}"\ndesign = "d"'
    if kind == "conditional" and kind_of_surrogate == "polynomial-chaos":
        with pytest.raises(uqpen.StudyError, match='"gaussian-process" takes any inputs'):
            made(study_of, kind, design)
        return
    study, (mean, variance, probability, index) = made(study_of, kind, design)
    tree = uqpen.run(study)
    statistics = tree["statistics/s/y"]
    holds(statistics["mean"], mean)
    holds(statistics["std"], variance**0.5)
    holds(statistics["exceedance"], probability)
    first = statistics["first_order"].sel(input="a")
    if kind == "conditional":
        assert np.isnan(first).all()
        note = SourceStatistics(tree).statistics("s", "y")["first_order"].coords["note"].values
        assert {*np.ravel(note)} == {"its inputs are drawn in one order, each given those before"}
    else:
        holds(first, index)
