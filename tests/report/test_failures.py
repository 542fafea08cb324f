"""Failed runs: their reasons, their probability, and their inputs."""

import numpy as np
import xarray as xr

import uqpen
from uqpen.archive.estimates import pack
from uqpen.archive.read import read_group
from uqpen.charts.chart import Chart
from uqpen.report.blocks import Fold, Table, Text
from uqpen.report.plotly import traces
from uqpen.report.sections.failures import failures
from uqpen.results.archive_view import ArchiveView
from uqpen.statistics.failure_analysis import failure_analysis
from uqpen.statistics.run_samples import sample_of

TOO_HEAVY = 'ValueError: too heavy (beam.py, line 4: raise ValueError("too heavy"))'


def _folded(block):
    assert isinstance(block, Fold)
    return block.blocks


def test_losses_are_reported_by_reason_and_design(archives):
    table, places, fold = failures(ArchiveView(archives["beam"], ""))
    assert isinstance(table, Table)
    assert table.table.columns == ["only\nof 120 runs"]
    assert table.table.rows == [(f"failed: {TOO_HEAVY}", ["22"])]
    (chances,) = _folded(fold)
    assert isinstance(chances, Chart)
    assert chances.summary == "only: failed 18.3 % (11.9 % to 26.4 %)."
    assert chances.y.rows == ("only",)
    assert chances.notes == ("Bars: 95 % intervals.",)
    group = read_group(archives["beam"], "failures", "only")
    reported = group["probability"].sel(status="failed").values
    (trace,) = traces(chances.marks)
    sides = trace["error_x"]
    drawn = [
        trace["x"][0],
        trace["x"][0] - sides["arrayminus"][0],
        trace["x"][0] + sides["array"][0],
    ]
    np.testing.assert_allclose(drawn, reported, rtol=1e-4)
    assert isinstance(places, Chart)


def test_inputs_that_go_with_losses_are_drawn(archives):
    _, chart, _ = failures(ArchiveView(archives["beam"], ""))
    assert isinstance(chart, Chart)
    assert chart.title == "Inputs associated with the failed runs of only"
    assert chart.y.rows == ("load", "span")
    assert chart.summary == (
        "The input with the strongest association is load: P(larger) 1.000, P(further out) 0.888 "
        "(0.812 … 0.935)."
    )
    # All lost runs have larger loads than the others, which there is no interval for.
    larger, further = traces(chart.marks)
    assert larger["marker"]["symbol"] == ["pentagon-open", "pentagon"]
    assert further["marker"]["symbol"] == ["cross", "cross"]
    assert [key.mark for key in chart.keys] == ["pentagon", "cross"]
    assert chart.notes[-2:] == (
        "Bars: 95 % intervals.",
        "Hollow: no interval; the table gives the reason.",
    )
    assert chart.tables[0].notes[0].startswith("probability of superiority: the input is larger")
    assert chart.tables[0].notes[2:] == ["the failed runs are completely separated from the others"]


def test_where_no_input_has_an_interval_the_legend_is_hollow_too(archives):
    tree = archives["beam"].copy(deep=True)
    group = tree["failures/only"]
    for name in ("larger", "further_out"):
        group[name][:, 1:] = np.nan
    _, chart, _ = failures(ArchiveView(tree, ""))
    assert isinstance(chart, Chart)
    drawn = {mark for trace in traces(chart.marks) for mark in trace["marker"]["symbol"]}
    assert drawn == {key.mark for key in chart.keys} == {"pentagon-open", "cross-open"}


def test_where_all_are_lost_no_input_goes_with_it(archives):
    table, places, _ = failures(ArchiveView(archives["lost"], ""))
    assert isinstance(table, Table)
    assert table.table.rows == [(f"failed: {TOO_HEAVY}", ["120"])]
    assert isinstance(places, Table)
    assert places.table.notes[2:] == ["no run completed"]


def test_where_none_is_lost_a_bound_is_reported(archives):
    (block,) = failures(ArchiveView(archives["schema_1_several"], "one"))
    assert block == Text(
        "All 16 runs completed. By monte_carlo, the model fails at a random point with a "
        "probability of at most 27 %, the upper end of its 95 % interval."
    )


def test_what_is_no_sample_has_a_share_without_an_interval(study_of):
    text = '[designs.some]\nkind = "quadrature"\norder = 3'
    tree = uqpen.run(study_of("np.where(a > 0.9, np.nan, a)", text, a=(0.0, 1.0)))
    *_, fold = failures(ArchiveView(tree, ""))
    (chart,) = _folded(fold)
    assert isinstance(chart, Chart)
    (table,) = chart.tables
    assert table.rows == [("some", ["0.25 ¹"])]
    assert table.notes == ["no interval: a share of its runs, which are no sample of the inputs"]
    assert chart.notes == ("Hollow: no interval; the table gives the reason.",)


def _with_reasons(study_of, reasons):
    """A study all runs of which failed, for these reasons."""
    text = f'[designs.some]\nkind = "monte-carlo"\nruns = {len(reasons)}'
    text += "\n[failures]\nstop_after = 0"
    tree = uqpen.run(study_of("np.nan * a", text, a=(0.0, 1.0)))
    runs = read_group(tree, "runs", "some")
    found = np.array(reasons, dtype=object)
    tree["runs/some"] = xr.DataTree(runs.assign(lost_reason=("lost_run", found)))
    return tree


def test_rare_reasons_are_counted_together(study_of):
    letters = [chr(ord("A") + max(number, 9)) for number in range(60)]
    table, *_ = failures(ArchiveView(_with_reasons(study_of, letters), ""))
    assert isinstance(table, Table)
    assert table.table.rows[0] == ("not finite: J", ["10"])
    assert table.table.rows[-2:] == [("31 less frequent reasons", ["31"]), ("all", ["60"])]
    assert len(table.table.rows) == 22


def test_reasons_that_differ_in_numbers_alone_are_one(study_of):
    newton = [f"no root of x1 after {n} steps (residual {n}.5e-4)" for n in range(20)]
    codes = ["exit code 1", "exit code 2"] * 5
    table, *_ = failures(ArchiveView(_with_reasons(study_of, [*newton, *codes]), ""))
    assert isinstance(table, Table)
    assert table.table.rows == [
        ("not finite: no root of x1 after # steps (residual #) ¹", ["20"]),
        ("not finite: exit code 1", ["5"]),
        ("not finite: exit code 2", ["5"]),
        ("all", ["30"]),
    ]
    assert table.table.notes == ["such as: no root of x1 after 0 steps (residual 0.5e-4)"]


def test_only_some_of_many_inputs_are_drawn(wide):
    runs = read_group(wide, "runs", "monte_carlo")
    lost = runs["heat_transfer_in_layer_x"].values > 1.1
    tree = wide.copy()
    tree["failures/monte_carlo"] = xr.DataTree(_where_lost(runs, lost))
    tree["runs/monte_carlo"] = xr.DataTree(runs.assign(status=("run", 2 * lost.astype(np.int8))))
    _, chart, _ = failures(ArchiveView(tree, ""))
    assert isinstance(chart, Chart)
    assert chart.y.rows[0] == "heat transfer in layer x"
    assert len(chart.y.rows) == 15
    assert chart.notes[-1] == "Shown are 15 of 24 inputs; the table has all."
    assert len(chart.tables[0].rows) == 24


def _where_lost(runs, lost):
    status = runs["status"].copy(data=np.where(lost, 2, 0))
    return pack(failure_analysis(sample_of(runs.assign(status=status), "status")))
