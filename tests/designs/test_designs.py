"""What holds of every design, and what each promises of its own."""

import tracemalloc

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy import special
from scipy.stats import qmc

from uqpen.core.errors import Problem, SettingsError, TableError
from uqpen.core.lookup import resolve
from uqpen.core.model import Input
from uqpen.core.streams import Stream
from uqpen.designs import DESIGNS
from uqpen.designs.data import TableDesign
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.one_at_a_time import Morris, OneAtATime
from uqpen.designs.quadrature import FullFactorial, Quadrature
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
from uqpen.designs.salib_designs import FastSampler, FiniteDifferences, FractionalFactorial
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal, Uniform

LENGTH, MASS, SHARE = Input("length", "m"), Input("mass", "kg"), Input("share", "1")
LAW = JointDistribution(
    (
        RandomInput(LENGTH, Uniform(1.0, 3.0), "m"),
        FixedInput(MASS, 5.0, "kg"),
        RandomInput(SHARE, Normal(0.0, 1.0), "1"),
    ),
    (LENGTH, MASS, SHARE),
)
STREAM = Stream(1, "designs", "mine")


def law_of_many(inputs):
    variables = tuple(Input(f"x{number}", "1") for number in range(inputs))
    uniform = (RandomInput(variable, Uniform(0.0, 1.0), "1") for variable in variables)
    return JointDistribution(tuple(uniform), variables)


def points(design, joint=LAW, stream=STREAM):
    (only,) = design.rounds(joint, stream)
    return points_in_memory(only)


RANDOM_DESIGNS = [
    MonteCarlo(1024),
    LatinHypercube(1024, replicates=8),
    LatinHypercube(1024, replicates=1),
    LatinHypercube(64, replicates=2, optimization="random-cd"),
    SobolSequence(1024),
    Halton(1024),
]


# Those whose points are no sample of the law.
OTHER_DESIGNS = [
    Quadrature(4),
    Quadrature(4, "sparse"),
    Quadrature(4, rule="leja"),
    FullFactorial(7),
    Morris(20),
    OneAtATime(),
    FastSampler(N=65),
    FiniteDifferences(N=16),
    FractionalFactorial(),
]


def test_every_kind_of_design_is_tested():
    tested = {type(design) for design in [*RANDOM_DESIGNS, *OTHER_DESIGNS]}
    # The points of two come from files, and those of some come in rounds.
    elsewhere = {"table", "data", "saltelli", "multifidelity", "interval-bounds"}
    elsewhere |= {"least-squares", "posterior", "posterior-by-surrogate"}
    elsewhere |= {"subset-simulation", "importance-sampling", "form", "active-learning"}
    kinds = {name: resolve(reference) for name, reference in DESIGNS.items()}
    assert {kind for name, kind in kinds.items() if name not in elsewhere} == tested


@pytest.mark.parametrize("design", [*RANDOM_DESIGNS, *OTHER_DESIGNS], ids=str)
def test_a_stream_gives_the_points_that_a_design_says(design):
    drawn = points(design)
    assert drawn.sizes["run"] == design.run_count(LAW)
    assert drawn.identical(points(design))
    assert drawn["mass"].dims == ()
    assert float(drawn["mass"]) == 5.0


@pytest.mark.parametrize("design", RANDOM_DESIGNS, ids=str)
def test_no_point_is_drawn_twice_under_one_name_or_another(design):
    drawn, other = points(design), points(design, stream=Stream(1, "designs", "other"))
    assert not np.isin(drawn["length"], other["length"]).any()
    for name in ("length", "share"):
        assert len(np.unique(drawn[name])) == design.run_count(LAW)


@pytest.mark.parametrize("design", OTHER_DESIGNS, ids=str)
def test_what_is_no_sample_says_so_and_stays_inside_the_law(design):
    assert not design.sampling.is_sample
    drawn = points(design)
    assert np.isfinite(drawn["share"]).all()
    assert bool(((drawn["length"] > 1.0) & (drawn["length"] < 3.0)).all())


@pytest.mark.parametrize("design", [Quadrature(4), FullFactorial(7), OneAtATime()], ids=str)
def test_what_is_not_drawn_is_the_same_under_any_name(design):
    assert points(design).identical(points(design, stream=Stream(2, "designs", "other")))


@pytest.mark.parametrize("design", RANDOM_DESIGNS, ids=str)
def test_points_follow_the_law(design):
    drawn = points(design)
    assert bool(((drawn["length"] >= 1.0) & (drawn["length"] <= 3.0)).all())
    # Four standard errors of a mean of as many independent draws.
    error = 4 / design.run_count(LAW) ** 0.5
    assert float(drawn["length"].mean()) == pytest.approx(2.0, abs=0.577 * error)
    assert float(drawn["share"].mean()) == pytest.approx(0.0, abs=error)


@pytest.mark.slow
@pytest.mark.parametrize("optimization", ["none", "random-cd"])
@pytest.mark.parametrize(("each", "replicates"), [(2, 1), (17, 2)])
def test_every_stratum_of_every_hypercube_has_one_point(optimization, each, replicates):
    drawn = points(LatinHypercube(each * replicates, replicates, optimization))
    strata = np.floor((drawn["length"].values - 1.0) / 2.0 * each).astype(int)
    for replicate in range(replicates):
        inside = strata[drawn["replicate"].values == replicate]
        assert sorted(inside) == list(range(each))


@given(power=st.integers(1, 9), replicates=st.integers(2, 5))
def test_sobol_replicates_are_balanced_over_elementary_intervals(power, replicates):
    drawn = points(SobolSequence(2**power * replicates, replicates))
    unit = np.stack([(drawn["length"] - 1.0) / 2.0, special.ndtr(drawn["share"])], axis=1)
    for replicate in range(replicates):
        inside = unit[drawn["replicate"].values == replicate]
        # In two dimensions Sobol' points are a (0, m, 2)-net: one point in every such box.
        for first in range(power + 1):
            boxes = np.floor(inside * [2**first, 2 ** (power - first)]).astype(int)
            assert len({tuple(box) for box in boxes}) == 2**power


def test_a_lower_discrepancy_is_what_optimization_is_for():
    plain, better = (
        points(LatinHypercube(100, 1, optimization)) for optimization in ("none", "random-cd")
    )
    unit = [np.stack([(p["length"] - 1) / 2, special.ndtr(p["share"])], 1) for p in (plain, better)]
    assert qmc.discrepancy(unit[1]) < 0.8 * qmc.discrepancy(unit[0])


@pytest.mark.parametrize(
    ("runs", "replicates", "nearest"),
    [(1000, 16, "512 or 1024"), (16, 16, "such as 32,"), (100, 2, "64 or 128"), (4, 3, "6")],
)
def test_a_sobol_design_of_another_size_is_refused_naming_the_nearest(runs, replicates, nearest):
    with pytest.raises(SettingsError, match="times a power of two") as caught:
        SobolSequence(runs, replicates)
    assert nearest in str(caught.value)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        # Nothing tells the error of a single set.
        (lambda: SobolSequence(64, replicates=1), "at least 2"),
        (lambda: Halton(64, replicates=1), "at least 2"),
        (lambda: LatinHypercube(1001, 10), "1000 or 1010"),
        (lambda: LatinHypercube(15, 10), "20"),
        (lambda: LatinHypercube(1, 1), ""),
        (lambda: LatinHypercube(5, 10), "20"),
        (lambda: LatinHypercube(100, 1, "lloyd"), 'one of "none", "random-cd"'),
        (lambda: LatinHypercube(2_000_000, 1_000_000), "at most 10_000"),
        (lambda: SobolSequence(2_000_000, 1_000_000), "at most 10_000"),
        (lambda: Halton(2_000_000, 1_000_000), "at most 10_000"),
        (lambda: MonteCarlo(0), "at least 1"),
    ],
)
def test_settings_that_cannot_be_are_refused(make, expected):
    with pytest.raises(SettingsError) as caught:
        make()
    assert expected in str(caught.value)


class TestTable:
    def write(self, folder, text, name="points.csv"):
        (folder / name).write_text(text, encoding="utf-8")
        return TableDesign(folder / name)

    def test_columns_are_read_in_their_units(self, tmp_path):
        table = self.write(tmp_path, "length [cm],share\n150,0.5\n200,-1e-1\n")
        drawn = points(table)
        assert drawn["length"].values.tolist() == [1.5, 2.0]
        assert drawn["share"].values.tolist() == [0.5, -0.1]
        assert float(drawn["mass"]) == 5.0

    def test_a_column_wins_over_a_fixed_input(self, tmp_path):
        table = self.write(tmp_path, "length [m], share, mass [g]\n1,0,7\n2,0,8\n")
        assert points(table)["mass"].values.tolist() == [0.007, 0.008]

    def test_a_byte_order_mark_and_blank_lines_are_no_matter(self, tmp_path):
        table = self.write(tmp_path, "\ufefflength [m],share\r\n\r\n1,2\r\n\r\n")
        assert points(table)["length"].values.tolist() == [1.0]

    def test_a_netcdf_file_is_read_like_a_csv_file(self, tmp_path):
        path = tmp_path / "points.nc"
        length = ("point", [150.0, 200.0], {"units": "cm"})
        xr.Dataset({"length": length, "share": ("point", [0.5, 1.0])}).to_netcdf(path)
        assert points(TableDesign(path))["length"].values.tolist() == [1.5, 2.0]

    def test_a_missing_value_in_a_netcdf_file_is_no_point(self, tmp_path):
        with netCDF4.Dataset(tmp_path / "points.nc", "w") as dataset:
            dataset.createDimension("point", 3)
            length = dataset.createVariable("length", "f8", ("point",))
            length.units = "m"
            length[0], length[2] = 1.0, 2.0
        with pytest.raises(TableError, match="no number at position 1"):
            points(TableDesign(tmp_path / "points.nc"))

    def test_a_table_is_read_once(self, tmp_path):
        table = self.write(tmp_path, "length [m],share\n1,2\n")
        assert table.run_count(LAW) == 1
        table.file.unlink()
        assert points(table)["length"].values.tolist() == [1.0]

    @pytest.mark.parametrize(
        ("text", "complaint"),
        [
            ("length [m];share\n1;2\n", "separated by semicolons"),
            ("length [m],share\n\n\n1,x\n", "line 4"),
            ('length [m],share\n1,"' + "x" * 200_000 + '"\n', "line 2: field larger"),
            ("lenght [m],share\n1,2\n", 'column "lenght" is no input; did you mean "length"'),
            ("length [kg],share\n1,2\n", 'in "kg"; expected a length'),
            ("length [frob],share\n1,2\n", "not a known unit"),
            ("length,share\n1,2\n", 'column "length" is without a unit; expected a length'),
            ("length [m],length [m]\n1,2\n", "stands twice"),
            ("length [m],share\n1\n", "line 2: 1 value under 2 headings"),
            ("length [m],share\n1,x\n", 'line 2, column "share": found "x"'),
            ("length [m],share\n1,nan\n", 'found "nan"'),
            ("length [m],share\n1,\n", 'found ""'),
            ("length [m],share\n", "no rows"),
            ("length [m]\n1\n", 'no column "share", an input that is random'),
            ("[m],share\n1,2\n", "not of the form"),
            ("", "is empty"),
        ],
    )
    def test_a_mistake_is_named(self, tmp_path, text, complaint):
        with pytest.raises(TableError) as caught:
            points(self.write(tmp_path, text))
        assert complaint in str(caught.value)

    def test_a_file_that_is_none_is_named(self, tmp_path):
        with pytest.raises(TableError, match="there is no file"):
            points(TableDesign(tmp_path / "absent.csv"))
        (tmp_path / "broken.nc").write_bytes(b"no netcdf")
        with pytest.raises(TableError, match="no NetCDF file"):
            points(TableDesign(tmp_path / "broken.nc"))
        (tmp_path / "latin.csv").write_bytes(b"l\xe4nge\n1\n")
        with pytest.raises(TableError, match="not UTF-8"):
            points(TableDesign(tmp_path / "latin.csv"))


@pytest.mark.parametrize(("each", "dimension"), [(2, 1), (3, 4), (17, 2), (1000, 10)])
def test_a_hypercube_is_that_of_scipy(each, dimension):
    drawn = LatinHypercube(each, 1).draw(np.random.default_rng(3), each, dimension)
    expected = qmc.LatinHypercube(dimension, rng=np.random.default_rng(3)).random(each)
    np.testing.assert_array_equal(drawn, expected)


def test_a_hypercube_takes_little_more_memory_than_its_points():
    rng = np.random.default_rng(3)
    tracemalloc.start()
    drawn = LatinHypercube(20_000, 1).draw(rng, 20_000, 10)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # SciPy's takes four times as much as its points.
    assert most < 1.5 * drawn.nbytes


def test_a_hypercube_that_is_too_large_to_be_drawn_whole_is_refused():
    law = law_of_many(2)
    assert list(LatinHypercube(2**26, 2).check_inputs(law)) == []
    assert list(LatinHypercube(10**12, 10_000).check_inputs(law_of_many(1))) == [
        Problem(
            ("runs",),
            "1000000000000: 10000 hypercubes of 100000000 points",
            "at most 67108864 points in each, as it is drawn whole: more replicates, or fewer runs",
        )
    ]
    (problem,) = LatinHypercube(10**8, 2).check_inputs(law)
    assert "at most 33554432 points in each" in problem.expected


def test_a_hypercube_that_takes_minutes_to_optimize_is_refused():
    law = law_of_many(2)
    assert list(LatinHypercube(2000, 2, "random-cd").check_inputs(law)) == []
    assert list(LatinHypercube(100_000, 2).check_inputs(law)) == []
    for design in (LatinHypercube(20_000, 1, "random-cd"), LatinHypercube(400, 100, "random-cd")):
        (problem,) = design.check_inputs(law)
        assert problem.path == ("optimization",)
        assert f"of {design.runs} points in {design.replicates} hypercubes" in problem.found


def test_a_sparse_grid_over_many_inputs_is_made_or_refused():
    # More than the 32 dimensions that an array of NumPy's may have.
    assert Quadrature(1, "sparse").run_count(law_of_many(40)) == 81
    (problem,) = Quadrature(3, "sparse").check_inputs(law_of_many(60))
    assert problem.found == "3, which over 60 random inputs combines 3.97e+04 grids"
    assert problem.expected == "at most 5000 grids: a lower order, or fewer inputs"
