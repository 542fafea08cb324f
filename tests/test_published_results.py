"""Published results of others, by the studies of ``studies/published``: what came of each."""

from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
import xarray as xr
from scipy import special, stats

import uqpen
from uqpen.core.model import Output
from uqpen.replication import LEVEL, ReadingResult, Replication, replicate
from uqpen.statistics.published import (
    Comparison,
    Publication,
    PublishedEstimates,
    TableComparison,
    _normal_score,
    compare_moments,
)

STUDIES = Path(__file__).parents[1] / "studies" / "published"

# Seeds are those of the studies. The samples are smaller than on the page, but decide as clearly:
# the first two lie within two standard errors, the others at more than four.
RESULTS = {
    "openturns_moments": {"openturns": None},
    "viscometer": {"monte_carlo_row": None, "first_order_row": ["tangent"]},
    "gravity": {"formula": ["second_mass"]},
}


@pytest.mark.parametrize("name", RESULTS)
def test_each_publication_has_the_verdict_of_the_page(name, tmp_path):
    study = uqpen.load_study(STUDIES / f"{name}.toml")
    path = tmp_path / f"{name}.nc"
    uqpen.make_archive(study, path)
    for publication, fitting in RESULTS[name].items():
        found = replicate(path, publication, trust=True)
        assert found.stated.is_rejected == (fitting is not None)
        # Where the study is rejected, one declared reading fits, and another one does not.
        assert [each.name for each in found.readings if each.fits] == (fitting or [])
        assert len(found.readings) == (2 if fitting else 0)


def test_the_printed_mean_of_the_force_is_improbable_beside_the_exact_one():
    # Its own standard error is that of 1 000 000 runs; a small sample here would blur it.
    published = uqpen.load_study(STUDIES / "gravity.toml").published["sample"]
    force = run_path(str(STUDIES / "gravity.py"))["force"]
    points, weights = np.polynomial.hermite_e.hermegauss(20)
    weights = weights / weights.sum()
    at_points = force(40e4, 30e4, 3.2 + 0.01 * points)["force"]
    exact = float(weights @ at_points)  # the masses are factors that do not depend on each other
    (figures,) = published.estimates
    z = (figures.mean - exact) / (figures.std / published.runs**0.5)
    assert z == pytest.approx(-2.67, abs=0.01)


def test_the_tangent_touches_the_equation_of_the_viscometer():
    model = run_path(str(STUDIES / "viscometer.py"))
    nominal = {"mu_c": 4.63, "t_m": 61, "t_c": 36.6, "rho_b": 2217, "rho_m": 1180, "rho_c": 810}
    for name, value in nominal.items():
        # A step of 1e-6 of the value: the curvature adds one of 1e-12, rounding 1e-16.
        moved = nominal | {name: value * (1 + 1e-6)}
        by_tangent = model["tangent"](**moved)["mu_m"]
        assert by_tangent == pytest.approx(model["viscosity"](**moved)["mu_m"], rel=1e-11)


@pytest.mark.parametrize(("error", "is_few"), [(0.0224, False), (0.05, True)], ids=str)
def test_few_runs_are_mentioned_where_a_tail_is_heavy(error, is_few):
    # The errors of a standard deviation of 1 by 1 000 runs with a kurtosis of 3 and of 11.
    figure = Comparison("y", "std", 1.1, 1.0, error, error, 0.05)
    stated = ReadingResult("", "", TableComparison((figure,), 1000, 0.01), (), ())
    assert Replication("paper", "A paper", stated, (), 1000).has_few_runs == is_few
    assert figure.decimals == 1


def test_right_publications_are_rejected_as_often_as_the_level_says(monkeypatch):
    """Four figures of two outputs that go together, each printed with two decimals."""
    # A probability of 5 % is known to 0.3 %, which is nothing beside 300 cases.
    monkeypatch.setattr("uqpen.statistics.published.VECTORS", 5_000)
    rng = np.random.default_rng(11)
    covariance = [[1.0, 0.8], [0.8, 1.0]]
    cases, rejected = 300, 0
    for _ in range(cases):
        theirs, ours = (rng.multivariate_normal([5, 5], covariance, size) for size in (400, 4000))
        estimates = tuple(
            PublishedEstimates(
                Output(name, "1"),
                mean=round(float(values.mean()), 2),
                std=round(float(values.std(ddof=1)), 2),
                rounding={"mean": 0.005, "std": 0.005},
            )
            for name, values in zip("ab", theirs.T, strict=True)
        )
        columns = {name: ("run", values) for name, values in zip("ab", ours.T, strict=True)}
        runs = xr.Dataset({"status": ("run", np.zeros(4000, dtype=np.int8)), **columns})
        publication = Publication("a paper", estimates, runs=400)
        rejected += compare_moments(publication, runs, rng).p < LEVEL
    # Neither bound is passed by a true rate of 5 % in one of a thousand repetitions.
    low, high = stats.binom(cases, LEVEL).ppf([0.0005, 0.9995])
    assert low <= rejected <= high


def rejected_of(cases, draw, rng):
    """Right publications of 400 heavy-tailed runs that 4 000 others reject."""
    found = 0
    for _ in range(cases):
        theirs, ours = draw(400), draw(4000)
        figures = {"mean": float(theirs.mean()), "std": float(theirs.std(ddof=1))}
        publication = Publication(
            "a paper", (PublishedEstimates(Output("a", "1"), **figures),), 400
        )
        columns = {"status": ("run", np.zeros(4000, dtype=np.int8)), "a": ("run", ours)}
        found += compare_moments(publication, xr.Dataset(columns), rng).p < LEVEL
    return found


def test_a_heavy_tail_rejects_right_publications_no_more_often(monkeypatch):
    monkeypatch.setattr("uqpen.statistics.published.VECTORS", 2_000)
    rng = np.random.default_rng(11)
    draw = lambda size: np.exp(rng.standard_normal(size))  # noqa: E731
    # By normal scores it is 8 %.
    assert rejected_of(200, draw, rng) <= stats.binom(200, LEVEL).ppf(0.9)


def test_the_score_of_a_mean_is_that_of_its_exact_distribution():
    # Means of 25 exponential values have a gamma distribution, means of few normal ones a
    # noise that is known from few: with the moments 1, 2 and 9, and 1, 0 and 3.
    size = 10**9
    for z in (1.5, 3.0, 6.0):
        figure = Comparison("a", "mean", 1 + z / 5, 1.0, 1 / 5, 0.0, 0.0)
        exact = -special.ndtri(special.gammaincc(25, 25 + 5 * z))
        assert _normal_score(figure, 1.0, size, 2.0, 9.0) == pytest.approx(exact, rel=1e-5)
        few = -special.ndtri(stats.t(12).sf(z))
        assert _normal_score(figure, 1.0, 12, 0.0, 3.0) == pytest.approx(few, rel=1e-9)
        # On the side without a tail the skewness accuses nothing.
        low = figure._replace(published=1 - z / 5)
        assert abs(_normal_score(low, 1.0, size, 2.0, 9.0)) <= z * (1 + 1e-9)
