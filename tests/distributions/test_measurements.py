"""Laws that follow from measurements: empirical ones, and families fitted to them."""

import math

import netCDF4
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from uqpen.core.columns import read_columns
from uqpen.core.errors import SettingsError, TableError
from uqpen.core.lookup import resolve
from uqpen.core.model import Bounds, Input
from uqpen.core.streams import Stream
from uqpen.distributions import DISTRIBUTIONS, measurements
from uqpen.distributions.measurements import (
    Empirical,
    check_measurements,
    fit_distribution,
    fitted_families,
    parameters_text,
)
from uqpen.distributions.univariate import Gamma, Gumbel, Lognormal, Normal, Truncated, Weibull

VALUES = st.lists(st.integers(-50, 50), min_size=2, max_size=30).filter(lambda x: len(set(x)) > 1)


def rng():
    return Stream(1, "inputs", "x", "fit").generator()


class TestEmpirical:
    LAW = Empirical((4.0, 1.0, 2.0, 8.0))

    def test_its_quantiles_run_straight_between_the_measurements(self):
        p = np.array([0.0, 0.1, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.95, 1.0])
        values = [1.0, 1.0, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 8.0, 8.0]
        np.testing.assert_allclose(self.LAW.ppf(p), values, rtol=1e-15)
        np.testing.assert_allclose(self.LAW.isf(1 - p), values, rtol=1e-15)
        assert self.LAW.median == 3.0

    def test_its_distribution_function_is_their_inverse(self):
        values = np.array([0.9, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 7.9, 8.0, 9.0])
        below = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.86875, 1.0, 1.0]
        np.testing.assert_allclose(self.LAW.cdf(values), below, rtol=1e-15)
        np.testing.assert_allclose(self.LAW.sf(values), 1 - np.array(below), atol=1e-15)

    def test_a_value_measured_twice_has_a_probability_of_its_own(self):
        distribution = Empirical((1.0, 2.0, 2.0, 3.0))
        np.testing.assert_allclose(distribution.ppf(np.array([0.4, 0.5, 0.6])), 2.0)
        assert distribution.cdf(np.array([2.0, 2.0 - 1e-12])) == pytest.approx([0.625, 0.375])

    @given(VALUES)
    def test_its_mean_is_the_measurements_and_nothing_leaves_their_range(self, values):
        distribution = Empirical(tuple(map(float, values)))
        # The quantile function is straight between multiples of 1 / 2n: the middles are exact.
        steps = 2 * len(values)
        drawn = distribution.ppf((np.arange(steps) + 0.5) / steps)
        assert drawn.mean() == pytest.approx(np.mean(values), abs=1e-12)
        assert min(values) <= drawn.min() <= drawn.max() <= max(values)
        assert distribution.is_finite

    @given(VALUES, st.floats(0.0, 1.0))
    def test_the_probability_below_a_quantile_is_its_own_or_a_step_holds_it(self, values, p):
        distribution = Empirical(tuple(map(float, values)))
        value = distribution.ppf(np.array(p))
        # Rounding may put a value a little below a step that it stands on.
        just_above = distribution.cdf(value + 1e-9)
        just_below = distribution.cdf(value - 1e-9)
        assert just_below - 1e-6 <= p <= just_above + 1e-6

    def test_it_is_truncated_as_any_law(self):
        distribution = Truncated(self.LAW, lower=2.0, upper=6.0)
        p = np.linspace(0, 1, 5)
        expected = self.LAW.ppf(0.375 + p * 0.375)
        np.testing.assert_allclose(distribution.ppf(p), expected, rtol=1e-12)

    @pytest.mark.parametrize("values", [(1.0, 1.0), (1.0, math.nan), (1.0, math.inf)])
    def test_measurements_that_make_no_law_are_refused(self, values):
        with pytest.raises(SettingsError):
            Empirical(values)


SAMPLE = stats.gamma(4.0, scale=100.0).rvs(size=80, random_state=np.random.default_rng(7))


class TestFit:
    def test_every_distribution_is_fitted_or_refused_with_a_reason(self):
        refused = {name for name, each in DISTRIBUTIONS.items() if resolve(each).unfitted_reason}
        assert set(DISTRIBUTIONS) - refused == {
            *("normal", "lognormal", "uniform", "rectangular", "log-uniform"),
            *("gamma", "weibull", "gumbel"),
        }
        assert set(fitted_families()) == set(DISTRIBUTIONS) - refused

    @pytest.mark.parametrize("scale", [1.0, 1e9, 1e-300])
    def test_the_parameters_are_the_likeliest(self, scale):
        found = {family: fit_law(family, SAMPLE * scale) for family in fitted_families()}
        normal = found["normal"]
        assert isinstance(normal, Normal)
        assert normal.mean == pytest.approx(SAMPLE.mean() * scale, rel=1e-12)
        assert normal.std == pytest.approx(SAMPLE.std() * scale, rel=1e-12)
        logarithms = np.log(SAMPLE)
        lognormal = found["lognormal"]
        assert isinstance(lognormal, Lognormal)
        assert lognormal.median == pytest.approx(math.exp(logarithms.mean()) * scale)
        ratio = math.log(float(lognormal.ppf(np.array(0.8413447460685429))) / lognormal.median)
        assert ratio == pytest.approx(logarithms.std())
        for family in ("uniform", "log-uniform"):
            # A rounding of the logarithm is one of the value times the logarithm.
            ends = found[family].ppf(np.array([0.0, 1.0]))
            assert ends == pytest.approx([SAMPLE.min() * scale, SAMPLE.max() * scale], rel=1e-13)

    def test_they_are_scipys_where_an_equation_is_solved(self):
        shape, _, scale = stats.gamma.fit(SAMPLE, floc=0)
        gamma = fit_law("gamma", SAMPLE)
        assert isinstance(gamma, Gamma)
        assert (gamma.mean / gamma.std) ** 2 == pytest.approx(shape, rel=1e-6)
        assert gamma.mean == pytest.approx(shape * scale, rel=1e-6)
        # SciPy stops its search for a maximum at a relative change of 1e-4.
        weibull = fit_law("weibull", SAMPLE)
        assert isinstance(weibull, Weibull)
        shape, _, scale = stats.weibull_min.fit(SAMPLE, floc=0)
        assert (weibull.shape, weibull.scale) == pytest.approx((shape, scale), rel=1e-4)
        gumbel = fit_law("gumbel", SAMPLE)
        assert isinstance(gumbel, Gumbel)
        location, scale = stats.gumbel_r.fit(SAMPLE)
        assert gumbel.mean == pytest.approx(stats.gumbel_r(location, scale).mean(), rel=1e-6)
        assert gumbel.std == pytest.approx(stats.gumbel_r(location, scale).std(), rel=1e-6)

    @pytest.mark.parametrize("family", fitted_families())
    def test_measurements_that_hardly_differ_are_fitted_too(self, family):
        sample = 1e3 + 1e-4 * SAMPLE
        distribution = fit_law(family, sample)
        assert distribution.is_finite
        middle = distribution.ppf(np.array([0.2, 0.8]))
        assert sample.min() < middle[0] < middle[1] < sample.max()

    def test_the_distance_is_scipys(self):
        found = fit_distribution("lognormal", SAMPLE, rng())
        scipys = stats.kstest(SAMPLE, lambda x: np.asarray(found.distribution.cdf(x)))
        assert found.distance == pytest.approx(scipys.statistic, rel=1e-12)

    def test_the_probability_is_scipys(self):
        sample = SAMPLE[:30]
        scipys = stats.goodness_of_fit(
            stats.norm, sample, statistic="ks", n_mc_samples=999, rng=np.random.default_rng(1)
        )
        found = fit_distribution("normal", sample, rng())
        # Each is a share of 999 draws, with a standard error of 0.016 at most; SciPy divides the
        # variance by n - 1.
        assert found.p_value == pytest.approx(scipys.pvalue, abs=0.05)

    def test_of_measurements_that_follow_the_family_few_are_called_bad(self):
        distribution = fit_law("normal", SAMPLE)
        draws = rng().random((60, 15))
        found = [
            fit_distribution("normal", distribution.ppf(row), rng(), samples=39).p_value
            for row in draws
        ]
        # Of 60 at a level of 0.1, more than 12 or fewer than 1 come up once in 100 times.
        assert 1 <= sum(p <= 0.1 for p in found) <= 12

    @given(
        st.lists(st.floats(1e-300, 1e300), min_size=5, max_size=8),
        st.sampled_from(fitted_families()),
    )
    def test_any_measurements_are_fitted_or_refused(self, values, family):
        try:
            distribution = fit_law(family, np.array(values))
        except SettingsError:
            return
        assert distribution.is_finite

    def test_very_many_measurements_take_fewer_samples(self, monkeypatch):
        monkeypatch.setattr(measurements, "_MOST_DRAWS", 200 * len(SAMPLE))
        counted = fit_distribution("normal", SAMPLE, rng()).p_value * 201
        assert counted == pytest.approx(round(counted), abs=1e-9)
        assert fit_distribution("uniform", SAMPLE, rng()).p_value == pytest.approx(1 / 201)

    def test_what_does_not_fit_is_called_so(self):
        assert fit_distribution("uniform", SAMPLE, rng()).is_rejected
        assert not fit_distribution("gamma", SAMPLE, rng()).is_rejected

    @pytest.mark.parametrize("family", ["lognormal", "log-uniform", "gamma", "weibull"])
    def test_a_law_of_positive_values_is_refused_for_others(self, family):
        with pytest.raises(SettingsError, match=r"-1; expected values above 0"):
            fit_distribution(family, np.array([-1.0, 2.0, 3.0, 4.0, 5.0]), rng())


def fit_law(family, values):
    return fit_distribution(family, values, rng(), samples=0).distribution


class TestMeasurements:
    @pytest.fixture
    def table(self, tmp_path):
        """Measurements from a text."""

        def written(text):
            (tmp_path / "m.csv").write_text(text)
            return read_columns(tmp_path / "m.csv")

        return written

    def test_a_column_is_found_by_its_heading_or_its_name(self, table):
        found = table("specimen,yield [MPa],note\nA-1,400,\nA-2,410,dropped\n")
        for heading in ("yield [MPa]", "yield"):
            assert found.column(heading).values("Pa").tolist() == [400e6, 410e6]

    def test_the_only_column_needs_no_heading(self, table):
        assert table("yield [MPa]\n400\n").column("").name == "yield"

    def test_a_netcdf_variable_will_do(self, tmp_path):
        path = tmp_path / "m.nc"
        with netCDF4.Dataset(path, "w") as dataset:
            dataset.createDimension("specimen", 2)
            variable = dataset.createVariable("strength", "f8", ("specimen",))
            variable.units = "MPa"
            variable[:] = [400, 410]
        assert read_columns(path).column("strength").values("Pa").tolist() == [400e6, 410e6]

    @pytest.mark.parametrize(
        ("heading", "reported"),
        [
            ("", "has the columns a [m], b [m], b [s]"),
            ("c", 'no column "c"'),
            ("b", "stands twice"),
            ("a [s]", 'no column "a [s]"; did you mean'),
        ],
    )
    def test_a_column_that_is_none_is_reported(self, table, heading, reported):
        with pytest.raises(TableError) as caught:
            table("a [m],b [m],b [s]\n1,2,3\n").column(heading)
        assert reported in str(caught.value)

    @pytest.mark.parametrize(
        ("values", "found"),
        [
            ([1.0] * 9, "9 measurements"),
            ([1.0] * 10, "all the same"),
            ([*range(1, 10), -3.0], "-3 mm as measurement 10"),
        ],
    )
    def test_what_cannot_be_measurements_is_reported(self, table, values, found):
        column = table("x [mm]\n" + "\n".join(map(str, values))).column("")
        variable = Input("x", "m", bounds=Bounds(lower=0.0))
        (problem,) = check_measurements(column.values("m"), column, variable, fewest=10)
        assert found in problem.found

    def test_parameters_are_shown_in_the_unit_of_the_measurements(self):
        assert parameters_text(Normal(300.15, 5.0), "degC") == "mean 27 degC, std 5 degC"
        assert parameters_text(Weibull(2.5, 0.012), "mm") == "shape 2.5, scale 12 mm"
        assert parameters_text(Normal(1.0, 0.5), "1") == "mean 1, std 0.5"
