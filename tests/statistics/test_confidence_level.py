"""The confidence level of a study: every interval has it, and everything that shows one says so."""

import numpy as np
import pytest
import xarray as xr
from scipy import special, stats

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.core.labels import BOUND, INTERVAL_LEVEL
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.study.identity import level_attribute

DESIGNS = {
    "mc": uqpen.MonteCarlo(runs=400),
    "lhs": uqpen.LatinHypercube(runs=400),
    "one": uqpen.LatinHypercube(runs=400, replicates=1),
    "blocks": uqpen.Saltelli(base=256, second_order=True),
    "paths": uqpen.Morris(trajectories=20),
}


def model(a, b):
    return {"y": np.where(a > 0.95, np.nan, a + 2 * b + a * b)}


def study(**changes):
    return uqpen.Study(
        uqpen.PythonModel(model, {"a": "1", "b": "1"}, {"y": "m"}, vectorized=True),
        {"a": uqpen.Uniform(0, 1), "b": uqpen.Uniform(0, 1)},
        {"y": uqpen.OutputSpec("m", exceeds=["2 m"], below=["1 m"], hold=[0.9], hold_above=[0.9])},
        DESIGNS,
        seed=1,
        **changes,  # type: ignore[arg-type]
    )


@pytest.fixture(scope="module")
def usual():
    return uqpen.run(study())


@pytest.fixture(scope="module")
def narrow():
    return uqpen.run(study(confidence_level=0.8))


def arrays(tree):
    """Every array of estimates of an archive, with its path."""
    for node in tree.subtree:
        for name, array in node.to_dataset(inherit=False).data_vars.items():
            if BOUND in array.dims:
                yield f"{node.path}/{name}", array


def test_every_interval_states_the_level(narrow):
    with_bounds = {
        path: array for path, array in arrays(narrow) if np.isfinite(array.values[..., 1:]).any()
    }
    assert len(with_bounds) > 60
    assert {path for path, array in with_bounds.items() if array.attrs[INTERVAL_LEVEL] != 0.8} == (
        set()
    )


def test_every_interval_is_narrower_at_a_lower_level(usual, narrow):
    others = dict(arrays(narrow))
    for path, wide in arrays(usual):
        if "convergence" in path:
            continue  # parts of few runs may change their method with the level
        lower = wide.values[..., 1], others[path].values[..., 1]
        upper = wide.values[..., 2], others[path].values[..., 2]
        np.testing.assert_array_equal(wide.values[..., 0], others[path].values[..., 0])
        both = np.isfinite(lower[0]) & np.isfinite(lower[1])
        assert (lower[0][both] <= lower[1][both]).all(), path
        above = np.isfinite(upper[0]) & np.isfinite(upper[1])
        assert (upper[0][above] >= upper[1][above]).all(), path
        if "exceedance_" not in path and (both.any() or above.any()):
            is_same = np.array_equal(lower[0], lower[1], equal_nan=True) and np.array_equal(
                upper[0], upper[1], equal_nan=True
            )
            assert not is_same, path


def test_the_intervals_are_those_of_the_formulas(narrow):
    statistics, runs = narrow["statistics/mc/y"], narrow["runs/mc"]
    values = np.sort(runs["y"].values[np.isfinite(runs["y"].values)])
    n, failed = len(values), int(np.isnan(runs["y"].values).sum())
    half = stats.t.ppf(0.9, n - 1) * values.std(ddof=1) / np.sqrt(n)
    mean, lower, upper = statistics["mean"].values
    furthest = (values[-1] - mean) / n, (mean - values[0]) / n
    assert (mean - lower, upper - mean) == pytest.approx((half + furthest[1], half + furthest[0]))
    k = int((values < 1).sum())
    assert statistics["below"].values[0, 1:] == pytest.approx(
        [
            special.betaincinv(k, n + failed - k + 1, 0.1),
            special.betaincinv(k + failed + 1, n - k, 0.9),
        ]
    )
    # The smallest rank with P(Binomial(n, 0.9) <= rank - 1) >= 0.8.
    rank = int(stats.binom.ppf(0.8, n, 0.9)) + 1
    assert statistics["tolerance_limit"].values[0, 2] == values[rank - 1]
    # ln 0.2 / ln 0.9 = 15.3
    assert statistics["content_runs_needed"].values.tolist() == [16]


def test_no_point_moves_and_no_run(usual, narrow):
    for design in DESIGNS:
        xr.testing.assert_identical(
            usual[f"runs/{design}"].to_dataset(), narrow[f"runs/{design}"].to_dataset()
        )


def test_everything_that_shows_an_interval_names_the_level(narrow):
    assert list(find_faults(narrow)) == []
    assert narrow.attrs["confidence_level"] == 0.8
    assert archive_json(narrow)["confidence_level"] == 0.8
    tables = list(output_tables(narrow))
    assert all(table.title.endswith(", 80 % intervals") for table in tables)
    notes = [note for table in tables for note in table.notes]
    assert "at most: one-sided tolerance bound, 80 % confidence" in notes
    assert not any("95 %" in note for note in notes)
    page = str(list(answer(ArchiveView(narrow, "")))).replace("\u00a0", " ").replace("\\xa0", " ")
    assert "(80 % confidence)" in page
    assert "80 % interval" in page
    # The distribution function is read off at 95 %, too.
    assert "95 % interval" not in page
    assert "95 % confidence" not in page


def test_the_usual_level_is_stated_nowhere_but_at_intervals(usual):
    assert "confidence_level" not in usual.attrs
    assert "confidence_level" not in archive_json(usual)
    assert "confidence_level" not in study().to_toml()
    assert not any("intervals" in table.title for table in output_tables(usual))
    stated = study(confidence_level=0.95)
    assert stated.quantities_of_interest == study().quantities_of_interest
    assert level_attribute(stated) == {}


@pytest.mark.parametrize("level", ["0.4", "1", "90", '"90 %"'])
def test_a_wrong_level_is_refused_with_its_line(study_of, level):
    text = study_of("a", a=(0, 1)).text
    with pytest.raises(uqpen.StudyError) as caught:
        uqpen.Study.of(uqpen.parse_study(f"confidence_level = {level}\n{text}"))
    assert "study.toml:1  confidence_level" in str(caught.value)
    assert f"found     {level}" in str(caught.value)
    assert "a confidence level above 0.5 and below 1, such as 0.9" in str(caught.value)
