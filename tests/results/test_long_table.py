"""All estimates of an archive in one table, which agrees with what the archive holds."""

import math

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.archive.estimates import estimate_array, pack
from uqpen.results.json import archive_json
from uqpen.results.long_table import estimate_rows, long_table, rows_frame, statistics_rows
from uqpen.results.source_statistics import SourceStatistics

STUDY = study_text(
    seed=3,
    models={"one": {"use": "ishigami"}, "two": {"use": "ishigami", "a": 6}},
    inputs=dict.fromkeys(("x1", "x2", "x3"), (-3, 3)),
    outputs={"y": {"exceeds": ["4"], "hold": [0.9]}},
    designs={"plain": {"kind": "monte-carlo", "runs": 200}},
    published={"paper": {"source": "A paper", "y": {"mean": 3.5}}},
)

COLUMNS = [
    *("model", "source", "kind", "output", "statistic", "coordinates"),
    *("probability", "content", "threshold", "threshold_value", "input", "status"),
    *("estimate", "lower", "upper", "unit", "interval", "interval_label", "note"),
]


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(uqpen.parse_study(STUDY))


@pytest.fixture(scope="module")
def table(tree):
    return long_table(tree)


def _rows(table, **wanted):
    for column, value in wanted.items():
        table = table[table[column] == value]
    return table


def test_its_columns_say_what_of_what_and_how_sure(table):
    assert list(table.columns) == COLUMNS
    kinds = ["design", "publication", "difference", "model form"]
    assert list(dict.fromkeys(table["kind"])) == kinds
    assert list(dict.fromkeys(table["model"])) == ["one", "two", "two minus one", ""]


def test_it_agrees_with_the_json(tree, table):
    reported = archive_json(tree)["models"]["two"]["designs"]["plain"]["outputs"]["y"]
    of_model = _rows(table, model="two", source="plain", output="y")
    for statistic, coordinates, expected in (
        ("mean", "", reported["mean"]),
        ("quantile", "probability=0.95", reported["quantiles"]["0.95"]),
        ("tolerance_limit", "content=0.9", reported["hold"]["0.9"]),
        ("exceedance", "threshold=4", reported["exceedance"]["4"]),
        ("first_order", "input=x2", reported["sensitivity"]["x2"]["first_order"]),
        (
            "exceedance_first_order",
            "threshold=4, input=x1",
            reported["sensitivity_of_exceedance"]["4"]["x1"]["first_order"],
        ),
    ):
        (row,) = _rows(of_model, statistic=statistic, coordinates=coordinates).to_dict("records")
        for key in ("estimate", "lower", "upper"):
            assert row[key] == expected[key] or (math.isnan(row[key]) and expected[key] is None)
        assert row["interval"] == expected["interval"]
        assert row["interval_label"] == expected["interval_label"]
        assert row["note"] == expected.get("note", "")


def test_an_entry_is_reported_by_its_coordinates(table):
    quantiles = _rows(table, model="one", source="plain", statistic="quantile")
    assert quantiles["probability"].tolist() == [0.05, 0.5, 0.95]
    assert quantiles["input"].isna().all()


def test_a_publication_and_a_difference_are_sources(table):
    (paper,) = _rows(table, model="one", kind="publication").to_dict("records")
    assert (paper["statistic"], paper["estimate"]) == ("mean", 3.5)
    assert math.isnan(paper["lower"])
    difference = _rows(table, kind="difference")
    assert set(difference["source"]) == {"plain"}
    assert {"mean", "std", "quantile"} <= set(difference["statistic"])


def test_ends_of_runs_are_of_no_output(table):
    ends = _rows(table, model="one", source="plain", output="")
    assert set(ends["statistic"]) == {"probability"}
    assert "crashed" in set(ends["status"])


def test_distribution_functions_are_listed_on_demand(tree, table):
    assert not {"cdf", "cdf_band", "cdf_value"} & set(table["statistic"])
    everything = long_table(tree, functions=True)
    places = _rows(everything, model="one", source="plain", statistic="cdf_value")
    assert len(places) > 100
    assert places["lower"].isna().all()
    assert len(_rows(everything, model="one", source="plain", statistic="cdf")) == len(places)


def test_one_model_has_a_table_of_its_own(tree, table):
    own = rows_frame(statistics_rows(SourceStatistics(tree["models/two"]), "two"))
    listed = _rows(table, model="two").reset_index(drop=True)
    pd.testing.assert_frame_equal(own, listed[own.columns.tolist()])


def test_a_statistic_that_an_archive_lacks_is_absent(tree):
    pruned = tree["models/one"].copy()
    node = pruned["statistics/plain/y"]
    node.dataset = node.to_dataset().drop_vars("quantile")
    statistics = SourceStatistics(pruned)
    assert statistics.get("plain", "y", "quantile") is None
    assert "quantile" not in set(rows_frame(statistics_rows(statistics))["statistic"])


def test_a_statistic_of_somebody_elses_is_described_by_its_own_attributes(tree):
    ranges = estimate_array(
        [[2.0, 1.0, 3.0], [4.0, np.nan, np.nan]],
        {"share": 2},
        {"interval": ["bootstrap", "none"], "interval_label": ["nominal", "none"], "note": ""},
        units="m",
        long_name="range that holds a share",
    ).assign_coords(share=[0.5, 0.9])
    extended = tree["models/one"].copy()
    extended["statistics/plain/y"] = xr.DataTree(pack({"central_range": ranges}))
    statistics = SourceStatistics(extended)
    assert list(statistics.statistics("plain", "y"))[-1] == "central_range"
    found = _rows(rows_frame(statistics_rows(statistics)), statistic="central_range")
    assert found["share"].tolist() == [0.5, 0.9]
    assert found["coordinates"].tolist() == ["share=0.5", "share=0.9"]
    assert found["estimate"].tolist() == [2.0, 4.0]
    assert found["unit"].tolist() == ["m", "m"]
    assert found["interval"].tolist() == ["bootstrap", "none"]


def test_an_archive_without_estimates_has_an_empty_table():
    found = rows_frame(statistics_rows(SourceStatistics(xr.DataTree())))
    assert len(found) == 0
    assert {"estimate", "statistic"} <= set(found.columns)


def test_corrected_estimates_have_the_surrogates_own_figure_beside_them():
    means = xr.DataArray(
        [1.0, 0.9, 1.1],
        dims="bound",
        coords={"surrogate_estimate": 1.05, "equivalent_runs": 400.0},
        attrs={"units": "m"},
    )
    plain = means.drop_vars(["surrogate_estimate", "equivalent_runs"])

    table = rows_frame([*estimate_rows(means, statistic="mean"), *estimate_rows(plain)])

    assert table["surrogate_estimate"].tolist() == pytest.approx([1.05, math.nan], nan_ok=True)
    assert table["equivalent_runs"].tolist() == pytest.approx([400.0, math.nan], nan_ok=True)
    assert "surrogate_estimate" not in rows_frame(estimate_rows(plain))
