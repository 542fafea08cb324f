"""All runs of an archive in one table, and the files of it that other programs read."""

import importlib.util
import io
import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import uqpen
from uqpen.core.columns import read_columns
from uqpen.core.errors import ExportError
from uqpen.designs import DESIGNS
from uqpen.results.export import table_content
from uqpen.results.long_table import run_table_parts, runs_table


def file_of(table, kind):
    return b"".join(table_content([table], kind))


def _model(length, width):
    if width > 0.31:
        raise ValueError("it is too wide")
    return {"area": length * width, "course": length * np.array([1.0, 2.0])}


@pytest.fixture(scope="module")
def archive():
    study = uqpen.Study(
        seed=1,
        model=uqpen.PythonModel(
            _model,
            inputs={"length": "m", "width": "m"},
            outputs={
                "area": "m2",
                "course": uqpen.OutputSpec(
                    "m", along={"time": {"unit": "s", "values": [0.5, 2.0]}}
                ),
            },
        ),
        inputs={"length": uqpen.Uniform(lower="10 cm", upper="90 cm"), "width": "(30 ± 1) cm"},
        outputs={"area": {"unit": "cm2"}, "course": {"unit": "mm"}},
        designs={
            "draws": uqpen.MonteCarlo(runs=30),
            "strata": uqpen.LatinHypercube(runs=20, replicates=2),
        },
    )
    return uqpen.run(study)


def test_a_row_has_a_run_in_the_units_of_the_study(archive):
    table = archive.runs_to_frame()
    assert [*table] == [
        *("design", "run", "replicate", "length [cm]", "width [cm]", "area [cm2]"),
        *("course at time = 0.5 s [mm]", "course at time = 2 s [mm]", "status", "reason"),
    ]
    assert len(table) == 50
    completed = table[table["status"] == "ok"]
    product = completed["length [cm]"] * completed["width [cm]"]
    np.testing.assert_allclose(completed["area [cm2]"], product, rtol=1e-12)
    course = completed["course at time = 2 s [mm]"]
    np.testing.assert_allclose(course, 20 * completed["length [cm]"], rtol=1e-12)


def test_a_failed_run_has_its_reason_and_no_outputs(archive):
    table = runs_table(archive)
    failed = table[table["width [cm]"] > 31]
    assert 0 < len(failed) < 25
    assert set(failed["status"]) == {"failed"}
    assert failed["reason"].str.contains("it is too wide").all()
    assert failed["area [cm2]"].isna().all()
    assert (table[table["width [cm]"] <= 31]["reason"] == "").all()


def test_a_category_is_in_words(archives):
    table = runs_table(archives["rods"])
    kinds = table[table["status"] == "ok"].groupby("model")["termination"].agg(set)
    assert kinds["rigid"] == {"rigid"}
    assert kinds["original"] == {"v = u", "u = 0"}


def test_values_in_si_units_are_those_of_the_archive(archive):
    table = runs_table(archive, si=True)
    draws = table[table["design"] == "draws"]
    runs = archive["runs/draws"].to_dataset()
    np.testing.assert_array_equal(draws["area [m2]"], runs["area"])
    np.testing.assert_array_equal(draws["length [m]"], runs["length"])


def test_replicates_stay_whole_numbers_beside_a_design_without(archive):
    replicates = runs_table(archive)["replicate"]
    assert replicates[:30].isna().all()
    assert [str(each) for each in replicates[30:].unique()] == ["0", "1"]


def test_a_csv_file_has_every_digit_and_is_read_back_as_a_table_of_points(archive, tmp_path):
    table = runs_table(archive)
    path = tmp_path / "runs.csv"
    path.write_bytes(file_of(table[["length [cm]", "width [cm]"]], "csv"))
    length, width = read_columns(path).columns
    assert (length.name, length.unit) == ("length", "cm")
    np.testing.assert_array_equal(width.load(), table["width [cm]"])


def test_json_has_an_object_for_each_row_and_null_for_what_is_missing(archive):
    table = runs_table(archive)
    rows = json.loads(file_of(table, "json"))
    assert len(rows) == len(table)
    failed = [row for row in rows if row["status"] == "failed"]
    assert all(row["area [cm2]"] is None for row in failed)
    assert rows[0]["replicate"] is None
    assert rows[40]["replicate"] == 1
    assert rows[0]["length [cm]"] == table["length [cm]"][0]


@pytest.mark.parametrize("kind", ["csv", "json"])
def test_statistics_are_written_in_plain_formats(archive, kind):
    table = archive.to_frame()
    content = io.BytesIO(file_of(table, kind))
    read = pd.read_csv(content, keep_default_na=False) if kind == "csv" else pd.read_json(content)
    assert [*read] == [*table]
    assert len(read) == len(table)


def test_parquet_is_written_or_names_the_package_that_it_needs(archive):
    table = archive.to_frame()
    if importlib.util.find_spec("pyarrow") is None:
        with pytest.raises(ExportError, match="Parquet needs pyarrow: pip install pyarrow"):
            file_of(table, "parquet")
    else:
        pd.testing.assert_frame_equal(pd.read_parquet(io.BytesIO(file_of(table, "parquet"))), table)


MEASURED = """measured = ["six"]
        [measured.six]
        unknown = ["x1"]
        fixed = ["x2", "x3"]
        [measured.six.table]
        y = [6.0]
        [measured.six.y]
        std = 1
"""

DESIGN_TABLES = {
    "monte-carlo": "runs = 8",
    "latin-hypercube": "runs = 8\nreplicates = 2",
    "sobol-sequence": "runs = 8\nreplicates = 2",
    "halton": "runs = 8\nreplicates = 2",
    "quadrature": "order = 2",
    "full-factorial": "levels = 2",
    "saltelli": "base = 32",
    "morris": "trajectories = 3",
    "one-at-a-time": "step = 0.01",
    "salib:fast_sampler": "N = 65",
    "salib:finite_diff": "N = 4",
    "salib:ff": "",
    "subset-simulation": 'event = "y > 5"\nsamples = 100\nreplicates = 3',
    "active-learning": 'event = "y > 5"\nlearning = 20\ncorrection = 60\nbatch = 10',
    "form": 'event = "y > 5"',
    "importance-sampling": 'event = "y > 5"\nsamples = 200\nreplicates = 3',
    "table": 'file = "points.csv"',
    "least-squares": f"at_most = 100\n{MEASURED}",
    "posterior": f"particles = 100\nat_most = 2_000\n{MEASURED}",
    "posterior-by-surrogate": f"runs = 20\nbatches = 1\nbatch = 10\nconfirm = 30\n{MEASURED}",
    "interval-bounds": 'events = ["y > 5"]\npilot = 50\nruns = 30',
}


@pytest.mark.parametrize("kind", DESIGN_TABLES)
def test_the_runs_of_each_kind_of_design_are_the_same_by_parts(kind, tmp_path):
    (tmp_path / "points.csv").write_text("x1,x2,x3\n0.1,0.2,0.3\n-1,1,2\n", encoding="utf-8")
    text = f"""
        seed = 1
        [model]
        use = "ishigami"
        [inputs]
        x1 = "0 ± 1"
        x2 = "0 ± 1"
        x3 = {"{ interval = [-1, 1] }" if kind == "interval-bounds" else '"0 ± 1"'}
        [designs.one]
        kind = "{kind}"
        {DESIGN_TABLES[kind]}
    """
    tree = uqpen.run(uqpen.parse_study(text, folder=tmp_path))
    whole = runs_table(tree)
    parts = pd.concat([*run_table_parts(tree)], ignore_index=True)
    assert len(whole) >= 2
    pd.testing.assert_frame_equal(parts, whole)
    assert file_of(parts, "csv") == b"".join(table_content(run_table_parts(tree), "csv"))


def test_weights_that_are_whole_numbers_remain_real_numbers(archive):
    tree = archive.copy()
    runs = tree["runs/draws"].to_dataset()
    whole = {"weight": ("run", np.ones(runs.sizes["run"]))}
    tree["runs/draws"] = xr.DataTree(runs.assign_coords(whole))
    table = runs_table(tree)
    assert table["weight"].dtype == np.float64
    assert table["replicate"].dtype == "Int64"


def test_each_kind_of_design_is_among_them():
    of_several_models, of_a_file = "multifidelity", "data"
    assert DESIGN_TABLES.keys() | {of_several_models, of_a_file} == DESIGNS.keys()
