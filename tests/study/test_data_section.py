"""A data file in place of a model: what is read, reported and refused."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import uqpen
from uqpen.core.errors import QuantityError
from uqpen.core.labels import AGREEMENT, CODED_INPUTS, DISTANT_VALUES, DROPPED_ROWS
from uqpen.core.status import Status
from uqpen.designs.data import DataDesign
from uqpen.report.blocks import Alerts
from uqpen.report.page import report_page
from uqpen.report.sections.answer import answer
from uqpen.report.sections.summary import summary_lines
from uqpen.results.archive_view import ArchiveView
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics import texts
from uqpen.verification.check_result import CheckOutcome

RUNS = Path(__file__).parents[1] / "data" / "runs"

LOADS, LENGTHS = (np.random.default_rng(seed).random(200) for seed in (1, 2))

STUDY = """
seed = 1
[model]
data = "runs.csv"
outputs = ["deflection"]
"""

INPUTS = """
[inputs]
load = { uniform = { lower = "0 kN", upper = "1 kN" } }
length = { uniform = { lower = "0 m", upper = "1 m" } }
"""

DESIGN = '[designs.given]\nkind = "data"\n'


def table(**columns):
    given = {"load [kN]": LOADS, "length [m]": LENGTHS, "deflection [mm]": LOADS * LENGTHS}
    return pd.DataFrame(given | columns).to_csv(index=False)


@pytest.fixture
def written(tmp_path):
    """Write a data file and its study, and read them."""

    def write(text=STUDY, runs=""):
        (tmp_path / "runs.csv").write_text(runs or table())
        (tmp_path / "beam.toml").write_text(text)
        return uqpen.load_study(tmp_path / "beam.toml")

    return write


def runs_of(study, design="given"):
    return uqpen.run(study)[f"runs/{design}"].to_dataset()


def mistakes(text, runs, written):
    with pytest.raises(uqpen.StudyError) as caught:
        written(text, runs)
    return [(problem.key, problem.found) for problem in caught.value.problems]


def test_inputs_outputs_and_units_come_from_the_headings(written):
    runs = runs_of(written(), "data")
    assert runs["load"].attrs["units"] == "N"
    assert runs["load"].attrs["display_units"] == "kN"
    assert np.array_equal(runs["load"], LOADS * 1000)
    assert np.array_equal(runs["deflection"], LOADS * LENGTHS * 0.001)
    assert [name for name in runs if runs[name].attrs.get("role") == "input"] == ["load", "length"]


def test_without_a_declaration_nothing_has_an_interval_and_the_reason_is_reported(written):
    found = uqpen.run(written())["statistics/data/deflection"]
    for name in ("mean", "quantile", "first_order", "pearson"):
        assert np.isfinite(found[name].sel(bound="estimate")).all()
        assert np.isnan(found[name].sel(bound=["lower", "upper"])).all()
    assert found["mean"].attrs["note"] == texts.NOT_DECLARED_INDEPENDENT


def test_the_statistics_are_those_of_runs_that_a_model_made(written):
    study = uqpen.Study(
        model=lambda load, length: {"deflection": load * length},
        inputs={"load": uqpen.Uniform("0 kN", "1 kN"), "length": uqpen.Uniform("0 m", "1 m")},
        outputs={"deflection": "mm"},
        designs={"given": uqpen.MonteCarlo(runs=300)},
        seed=3,
    )
    made = uqpen.run(study)
    exported = made["runs/given"].to_dataset()
    frame = pd.DataFrame({name: exported[name] for name in ("load", "length", "deflection")})
    frame.columns = pd.Index(["load [N]", "length [m]", "deflection [m]"])
    data = written(f"{STUDY}{INPUTS}{DESIGN}independent = true\n", frame.to_csv(index=False))
    again = uqpen.run(data)["statistics/given/deflection"]
    for name, array in made["statistics/given/deflection"].data_vars.items():
        assert np.array_equal(again[name], array, equal_nan=array.dtype.kind == "f"), name


def test_failed_runs_are_data(written):
    deflection = (LOADS * LENGTHS).astype(object)
    status = np.array(["ok"] * 200, dtype=object)
    reason = np.array([""] * 200, dtype=object)
    deflection[3], status[4], reason[4] = "", "Timed out", "a day"
    deflection[5] = "inf"
    columns = {"deflection [mm]": deflection, "status": status, "reason": reason}
    runs = runs_of(written(runs=table(**columns)), "data")
    expected = {3: Status.FAILED, 4: Status.TIMED_OUT, 5: Status.NOT_FINITE}
    assert {run: runs["status"].values[run] for run in runs["lost_run"].values} == expected
    reasons = ["deflection is blank", "a day", "deflection is infinite"]
    assert runs["lost_reason"].values.tolist() == reasons
    assert np.isnan(runs["deflection"].values[[3, 4, 5]]).all()


@pytest.mark.parametrize("word", ["FAIL", "fail", " Fail "])
def test_an_evaluation_that_failed_in_dakota_is_a_failed_run(written, word):
    deflection = (LOADS * LENGTHS).astype(object)
    deflection[[3, 7]] = word, ""
    runs = runs_of(written(runs=table(**{"deflection [mm]": deflection})), "data")
    assert runs["lost_run"].values.tolist() == [3, 7]
    assert (runs["status"].values[[3, 7]] == Status.FAILED).all()
    reasons = [f"deflection is {word.strip()}", "deflection is blank"]
    assert runs["lost_reason"].values.tolist() == reasons
    assert np.isnan(runs["deflection"].values[[3, 7]]).all()


def test_a_point_outside_the_constraints_is_inadmissible(written):
    table_of = table(**{"reach [kN]": np.full(200, 0.5)})
    runs = runs_of(written(STUDY + '[constraints]\nkeep = ["load < reach"]\n', table_of), "data")
    assert np.array_equal(runs["status"] == Status.INADMISSIBLE, LOADS >= 0.5)
    assert np.array_equal(np.isnan(runs["deflection"]), LOADS >= 0.5)


def test_rows_of_one_file_train_and_check_a_surrogate(written):
    designs = """
    [designs.training]
    kind = "data"
    last = 120
    [designs.check]
    kind = "data"
    first = 121
    independent = true
    [surrogates.pce]
    kind = "polynomial-chaos"
    design = "training"
    """
    tree = uqpen.run(written(STUDY + INPUTS + designs))
    assert tree["runs/training"].sizes["run"] == 120
    assert np.array_equal(tree["runs/check/load"], LOADS[120:] * 1000)
    assert tree["statistics/pce/deflection/mean"].values[0] == pytest.approx(2.5e-4, rel=1e-6)


@pytest.mark.parametrize("kind", ["latin-hypercube", "sobol-sequence", "halton"])
def test_replicates_of_a_design_give_intervals(kind, written):
    replicates = np.repeat(np.arange(7, 17), 20)
    study = written(f'{STUDY}{DESIGN}follows = "{kind}"\n', table(replicate=replicates))
    assert study.designs["given"].replicate_count == 10
    tree = uqpen.run(study)
    assert np.array_equal(tree["runs/given/replicate"], replicates - 7)
    mean = tree["statistics/given/deflection/mean"]
    assert mean.attrs["interval"].startswith(texts.STUDENT_OVER_REPLICATES)
    assert np.isfinite(mean.values).all()


def test_weights_are_those_of_the_file(written):
    study = written(STUDY + DESIGN + "independent = true\n", table(weight=LENGTHS))
    tree = uqpen.run(study)
    assert np.array_equal(tree["runs/given/weight"], LENGTHS)
    expected = np.average(LOADS * LENGTHS, weights=LENGTHS) * 0.001
    assert tree["statistics/given/deflection/mean"].values[0] == pytest.approx(expected)


def test_how_points_follow_the_stated_inputs_is_reported(written):
    text = f"{STUDY}{INPUTS}{DESIGN}independent = true\n"
    good = str(runs_of(written(text)).attrs[AGREEMENT])
    assert good.startswith("Kolmogorov's distance from [inputs]: load 0.")
    assert "; largest rank correlation: load and length " in good
    bad = str(runs_of(written(text, table(**{"load [kN]": LOADS**2}))).attrs[AGREEMENT])
    assert "load 0.2" in bad
    assert "(p < 0.0001)" in bad
    alike = {"length [m]": LOADS}
    bad = str(runs_of(written(text, table(**alike))).attrs[AGREEMENT])
    assert bad.endswith("load and length 1.000 (p < 0.0001)")
    # A p value is that of independent draws, which these points are not declared to be.
    undeclared = str(runs_of(written(STUDY + INPUTS + DESIGN)).attrs[AGREEMENT])
    assert "p =" not in undeclared


SURROGATE = """
[surrogates.pce]
kind = "polynomial-chaos"
design = "given"
order = 2
"""


def test_a_surrogate_of_points_that_contradict_the_stated_inputs_says_nothing(written):
    text = f"{STUDY}{INPUTS}{DESIGN}independent = true\n{SURROGATE}"
    order = np.argsort(np.argsort(LOADS + 0.2 * np.std(LOADS) * np.sin(np.arange(len(LOADS)))))
    alike = table(**{"length [m]": np.sort(LENGTHS)[order]})
    tree = uqpen.run(written(text, alike))
    for array in SourceStatistics(tree).statistics("pce", "deflection").values():
        assert np.isnan(array.values).all()
        for note in np.ravel(array.coords["note"].values):
            assert note.startswith("the runs contradict the stated independence of the inputs: ")
            assert "load and length 0.9" in note
    # The statistics of the runs are those of dependent inputs, and say so.
    first = SourceStatistics(tree).statistics("given", "deflection")["first_order"]
    assert all("includes correlation" in note for note in first.coords["note"].values)
    (dependence,) = (
        each
        for block in answer(ArchiveView(tree, ""))
        if isinstance(block, Alerts)
        for each in block.alerts
        if each.about == "Dependence"
    )
    assert "against what the study states: the rank correlation of load" in dependence.text
    # Points that are not declared draws of the inputs may lie anywhere.
    undeclared = uqpen.run(written(f"{STUDY}{INPUTS}{DESIGN}{SURROGATE}", alike))
    mean = SourceStatistics(undeclared).statistics("pce", "deflection")["mean"]
    assert np.isfinite(mean.values[0])


def test_a_wrong_unit_of_an_input_is_what_to_mind_first(written):
    text = f"{STUDY}{INPUTS}{DESIGN}independent = true\n"
    assert not any("do not follow" in line for line in summary_lines(uqpen.run(written(text))))
    tree = uqpen.run(written(text.replace("1 m", "1 cm")))
    told = next(line for line in summary_lines(tree) if line.startswith("mind: "))
    assert "The points of given do not follow the stated inputs" in told
    assert re.search(r"Kolmogorov's distance of length 0\.\d+ \(p < 0\.0001\)\.", told)
    # The points of a plan are no draws, and contradict nothing.
    plan = text.replace("independent = true\n", "").replace("1 m", "1 cm")
    assert not any("do not follow" in line for line in summary_lines(uqpen.run(written(plan))))


def test_an_archive_verifies_and_refuses_what_needs_a_model(written, tmp_path, command_line):
    study = written(STUDY + DESIGN + "independent = true\n")
    path = tmp_path / "beam.nc"
    uqpen.make_archive(study, path)
    (tmp_path / "runs.csv").unlink()  # the archive keeps it
    checks = {check.name: check for check in uqpen.verify(path)}
    assert {check.verdict for check in checks.values()} == {CheckOutcome.EQUAL}
    read = "not repeatable, as they come from a file; 200 read again from runs.csv: bit-equal"
    assert checks["runs"].text == read
    (tmp_path / "runs.csv").write_text(table())
    for command in ("run", "serve"):
        outcome = command_line(command, "beam.toml")
        assert outcome.code == 2
        assert "runs of a model that is not here" in outcome.err
    outcome = command_line("rerun", "beam.nc")
    assert outcome.code == 2
    assert "its runs come from a file (runs.csv)" in " ".join(outcome.err.split())


def test_a_changed_run_in_an_archive_is_found(written, tmp_path):
    archive = uqpen.make_archive(written(), tmp_path / "beam.nc")
    tree = archive.copy()
    runs = tree["runs/data"].to_dataset()
    runs["deflection"].values[7] += 1
    tree["runs/data"] = xr.DataTree(runs)
    uqpen.write(tree, tmp_path / "other.nc")
    outcomes = {check.name: check.verdict for check in uqpen.verify(tmp_path / "other.nc")}
    assert outcomes["runs"] is CheckOutcome.DIFFERENT


@pytest.mark.parametrize(
    ("file", "outputs", "units"),
    [
        ("openturns.csv", ["deviation"], {"E": "psi", "F": "lbf", "L": "inch"}),
        ("easyvvuq.csv", ["deflection", "stress_0"], {"F": "N"}),
        ("dakota.dat", ["stress", "displacement"], {"stress": "psi", "w": "inch"}),
    ],
)
def test_runs_of_other_programs_are_analysed(file, outputs, units):
    stated = ", ".join(f'{name} = "{unit}"' for name, unit in units.items())
    text = f'seed = 1\n[model]\ndata = "{file}"\noutputs = {outputs}\nunits = {{ {stated} }}\n'
    tree = uqpen.run(uqpen.parse_study(text, folder=RUNS))
    for output in outputs:
        assert np.isfinite(tree[f"statistics/data/{output}/mean"].values[0])
    for name, unit in units.items():
        assert tree[f"runs/data/{name}"].attrs["display_units"] == unit


FRAME = pd.DataFrame({"load [kN]": LOADS, "length": LENGTHS, "deflection": LOADS * LENGTHS})


def test_a_dataframe_is_a_data_file(tmp_path):
    study = uqpen.Study(
        model=FRAME,
        inputs={"length": uqpen.Uniform("0 m", "1 m")},
        outputs={"deflection": uqpen.OutputSpec("mm", exceeds=["0.5 mm"])},
        designs={"given": DataDesign(independent=True)},
        seed=1,
    )
    uqpen.make_archive(study, tmp_path / "beam.nc")
    runs = uqpen.open_archive(tmp_path / "beam.nc")["runs/given"]
    assert np.array_equal(runs["deflection"], LOADS * LENGTHS * 0.001)
    assert runs["length"].attrs["units"] == "m"
    outcomes = {check.verdict for check in uqpen.verify(tmp_path / "beam.nc")}
    assert outcomes == {CheckOutcome.EQUAL}


def test_a_dataset_is_a_data_file():
    units = {"load": "kN", "length": "m", "deflection": "mm"}
    values = (LOADS, LENGTHS, LOADS * LENGTHS)
    dataset = xr.Dataset(
        {
            name: ("run", each, {"units": units[name]})
            for name, each in zip(units, values, strict=True)
        }
    )
    runs = runs_of(uqpen.Study(model=dataset, outputs={"deflection": "cm"}, seed=1), "data")
    assert np.array_equal(runs["load"], LOADS * 1000)
    assert runs["deflection"].attrs["display_units"] == "cm"


def test_every_mistake_is_met_before_anything_is_read(written):
    text = STUDY.replace('"deflection"]', '"deflexion"]\nignore = ["x"]')
    assert mistakes(text, "", written) == [
        ("model.outputs[0]", 'no column "deflexion" in runs.csv'),
        ("model.ignore[0]", 'no column "x" in runs.csv'),
    ]
    assert mistakes(STUDY.replace('["deflection"]', "[]"), "", written) == [
        ("model.outputs", "no output")
    ]
    text = STUDY + 'inputs = ["load", "deflection"]\nunits = { load = "kM" }\n'
    assert ("model.units.load", '"kM", which is not a known unit') in mistakes(text, "", written)
    assert mistakes(STUDY, table().replace("[kN]", "[kM]"), written) == [
        ("model.data", '"kM", which is not a known unit, in the heading of "load"')
    ]
    text = table().replace("length [m]", "max-length")
    assert mistakes(STUDY, text, written) == [("model.data", 'a column "max-length" in runs.csv')]
    rows = table().splitlines()
    rows[9] = "1,,2"
    assert mistakes(STUDY, "\n".join(rows), written) == [
        ("model.data", 'nothing in column "length", runs.csv, line 10')
    ]
    rows[9] = "1,FAIL,2"
    assert mistakes(STUDY, "\n".join(rows), written) == [
        ("model.data", 'FAIL in column "length", runs.csv, line 10')
    ]
    rows[0], rows[9] = f"{rows[0]},status", "1,2,3,lost"
    runs = "\n".join([rows[0], rows[9]])
    assert mistakes(STUDY, runs, written) == [
        ("model.data", '"lost" in column "status", runs.csv, line 2')
    ]


def test_rows_with_a_blank_input_are_refused_all_at_once_or_dropped_and_counted(
    written, command_line
):
    loads = LOADS.astype(object)
    loads[[3, 7]] = "", "NA"
    loads[9] = "-9999"
    lengths = LENGTHS.astype(object)
    lengths[[7, 20]] = "", -9999
    runs = table(**{"load [kN]": loads, "length [m]": lengths})
    text = STUDY + 'missing = [-9999, "NA"]\n'
    assert mistakes(text, runs, written) == [
        ("model.data", 'nothing in column "load", runs.csv, line 5, line 9, line 11'),
        ("model.data", 'nothing in column "length", runs.csv, line 9, line 22'),
    ]
    study = written(text + 'drop = "blank inputs"\n', runs)
    found = runs_of(study, "data")
    kept = np.setdiff1d(np.arange(200), [3, 7, 9, 20])
    assert np.array_equal(found["load"], LOADS[kept] * 1000)
    assert np.array_equal(found["deflection"], (LOADS * LENGTHS)[kept] * 0.001)
    dropped = "4 of 200 rows of runs.csv are left out: an input is blank (load in 3, length in 2)"
    assert found.attrs[DROPPED_ROWS] == dropped
    assert dropped in " ".join(command_line("check", "beam.toml").out.split())
    assert mistakes(STUDY + 'missing = [true]\ndrop = "rows"\n', runs, written) == [
        ("model.missing[0]", "true"),
        ("model.drop", '"rows"'),
    ]


def test_a_value_that_stands_alone_is_reported(written):
    loads = LOADS.copy()
    loads[[4, 5]] = -9999
    study = written(runs=table(**{"load [kN]": loads}))
    (text,) = study.model.distant
    assert text.startswith("load: -9999 stands alone in 2 rows (runs.csv, line 6), and the others")
    assert runs_of(study, "data").attrs[DISTANT_VALUES] == text
    assert not written(STUDY + 'missing = [-9999]\ndrop = "blank inputs"\n').model.distant
    # The largest of 200 values may well be far from the others, by a multiple of their range.
    heavy = 1 / np.sort(LOADS)[:150]
    assert not written(runs=table(**{"load [kN]": [*heavy, *LOADS[:50]]})).model.distant
    # A number of nines stands for no value in many rows, too.
    many = np.where(np.arange(200) % 3, LOADS, -999)
    (text,) = written(runs=table(**{"load [kN]": many})).model.distant
    assert text.startswith("load: -999 stands alone in 67 rows")


def test_a_number_with_a_comma_is_refused_with_its_line(written, tmp_path, command_line):
    kinds = ["1,5", "2,5"] * 100
    with pytest.raises(uqpen.StudyError) as caught:
        written(STUDY, table(kind=kinds))
    (problem,) = caught.value.problems
    assert problem.found == '"1,5" in column "kind", runs.csv, line 2'
    assert problem.expected == "a number with a point, as 1.5"
    assert command_line("init", "runs.csv", "-o", "new.toml").code == 0
    assert '"kind" has texts; expected a number with a point' in (tmp_path / "new.toml").read_text()


def test_texts_are_categories_with_sorted_codes(written):
    soils, ends = np.array(["sand", "clay"])[[0, 1] * 100], np.array(["dry", "wet", "mud"])
    end = ends[np.arange(200) % 3].astype(object)
    end[4] = ""
    text = STUDY.replace('"deflection"', '"deflection", "end"')
    study = written(text, table(soil=soils, end=end))
    found = runs_of(study, "data")
    assert np.array_equal(found["soil"], soils == "sand")
    assert found.attrs[CODED_INPUTS].endswith(": soil as 0 clay, 1 sand")
    assert [each.label for each in study.model.outputs[1].categories] == ["dry", "mud", "wet"]
    assert found["end"].values[[0, 1, 2]].tolist() == [0, 2, 1]
    assert found["lost_run"].values.tolist() == [4]
    # One number among texts is a mistake, as is one text among numbers.
    soils = np.array(["sand", "clay", "1"])[np.arange(200) % 3]
    assert mistakes(STUDY, table(soil=soils), written) == [
        ("model.data", '"sand" in column "soil", runs.csv, line 2')
    ]


TOGETHER = """
seed = 1
surrogates.gp = { kind = "gaussian-process", design = "data" }
[model]
data = "runs.csv"
outputs = ["peak"]
ignore = ["Run"]
columns = { peak = "Peak flow (m3/s)", soil = "Soil type" }
missing = [-9999]
drop = "blank inputs"
together = true
"""


def test_ten_lines_make_drivers_and_predictions_of_a_table_as_people_write_it(
    written, tmp_path, command_line
):
    rain, area = 90 * LOADS + 10, LENGTHS + 1
    soil = np.where(np.arange(200) % 3, "clay", "sand")
    peak = rain * area * np.where(soil == "clay", 1.1, 1.0)
    columns = {"Run": np.arange(200), "Rain (mm)": rain.copy(), "Area [km2]": area}
    columns |= {"Soil type": soil, "Peak flow (m3/s)": peak}
    columns["Rain (mm)"][[3, 90]] = -9999
    study = written(TOGETHER, pd.DataFrame(columns).to_csv(index=False))
    uqpen.make_archive(study, tmp_path / "flood.nc")
    tree = uqpen.open_archive(tmp_path / "flood.nc")
    first = tree["statistics/data/peak/first_order"].sel(bound="estimate")
    assert first.idxmax().item() == "Rain"
    # The inputs of the surrogate are the rows, so its mean is that of the runs; it has no indices.
    of_rows, of_runs = (tree[f"statistics/{each}/peak/mean"].values[0] for each in ("gp", "data"))
    assert of_rows == pytest.approx(of_runs, rel=1e-3)
    note = SourceStatistics(tree).statistics("gp", "peak")["first_order"].coords["note"].values
    assert {*np.ravel(note)} == {
        "its draws are whole rows of a sample, of which no part is given the rest"
    }
    (tmp_path / "new.csv").write_text("Rain (mm),Area [km2],Soil type\n50,1.5,clay\n")
    assert command_line("predict", "flood.nc:gp", "new.csv", "-o", "found.csv").code == 0
    found = pd.read_csv(tmp_path / "found.csv")
    assert found["peak [m3/s]"][0] == pytest.approx(82.5, rel=0.01)
    assert 0 < found["peak_std [m3/s]"][0] < 1
    assert found["soil"][0] == "clay"
    (tmp_path / "new.csv").write_text("Rain (mm),Area (km2),soil\n50,1.5,mud\n")
    done = command_line("predict", "flood.nc", "new.csv")
    assert 'line 2, column "soil": found "mud"; known: clay, sand' in " ".join(done.err.split())
    with pytest.raises(QuantityError, match="a label of soil; known: clay, sand"):
        tree.surrogate("gp")(Rain=0.05, Area=1.5e6, soil="mud")
    wrong = mistakes(TOGETHER.replace("= true", "= 1"), "", written)
    assert ("model.together", "1") in wrong


def test_no_statistic_follows_the_order_of_texts(written):
    kinds = np.arange(200) * 7 % 3
    peak = np.where(LOADS < 0.05, np.nan, LOADS * (1 + LENGTHS) * np.array([1.0, 2.0, 0.5])[kinds])
    text = f"""{STUDY.replace("deflection", "peak")}{DESIGN}independent = true
[outputs.peak]
exceeds = ["0.8"]
"""
    trees = []
    for soils in (["clay", "sand", "peat"], ["sand", "peat", "clay"]):
        columns = {"load": LOADS, "length": LENGTHS, "soil": np.array(soils)[kinds], "peak": peak}
        trees.append(uqpen.run(written(text, pd.DataFrame(columns).to_csv(index=False))))
    for group in ("statistics/given/peak", "failures/given"):
        for name, array in trees[0][group].to_dataset(inherit=False).variables.items():
            same = trees[1][group].to_dataset(inherit=False).variables[name]
            if array.dtype.kind == "f":
                np.testing.assert_allclose(array, same, rtol=1e-9, atol=1e-12, err_msg=name)
            else:
                assert np.array_equal(array, same), name
    found = SourceStatistics(trees[0]).statistics("given", "peak")
    # An index is what the means of the texts explain; a correlation with codes is none.
    completed = pd.DataFrame({"soil": kinds, "peak": peak}).dropna()
    groups = completed.groupby("soil")["peak"]
    left = (groups.var() * groups.size()).sum() / len(completed)
    share = 1 - left / completed["peak"].var()
    index = found["first_order"].sel(input="soil", bound="estimate").item()
    assert index == pytest.approx(share, abs=1e-12)
    for name in ("spearman", "partial"):
        assert np.isnan(found[name].sel(input="soil")).all()
        assert texts.CODES_WITHOUT_ORDER in np.ravel(found[name].coords["note"].values)
    assert found["delta"].sel(input="soil", bound="estimate") > 0.2


COLUMNS = """
[model.columns]
rain = "Rain (mm)"
peak = "Peak flow (m3/s)"
[model.units]
length = "cm"
"""


def test_columns_have_the_names_that_the_study_gives_to_headings(written):
    runs = table().replace("load [kN]", "Rain (mm)").replace("deflection [mm]", "Peak flow (m3/s)")
    found = runs_of(written(STUDY.replace("deflection", "peak") + COLUMNS, runs), "data")
    assert np.allclose(found["rain"], LOADS / 1000, rtol=1e-15)
    assert found["peak"].attrs["display_units"] == "m3/s"
    assert np.allclose(found["length"], LENGTHS / 100, rtol=1e-15)  # the study's unit wins
    message = "the heading of a column in runs.csv"
    text = STUDY.replace("deflection", "Peak flow (m3/s)")
    assert ("model.outputs[0]", f'"Peak flow (m3/s)", {message}') in mistakes(text, runs, written)
    text = STUDY.replace("deflection", "peak") + COLUMNS
    wrong = text.replace("Rain (mm)", "Rein (mm)").replace('"Peak flow (m3/s)"', "3")
    assert mistakes(wrong, runs, written) == [("model.columns.peak", "3")]
    assert ("model.columns.rain", 'no column "Rein (mm)" in runs.csv') in mistakes(
        text.replace("Rain (mm)", "Rein (mm)"), runs, written
    )
    assert mistakes(text.replace("rain =", "length ="), runs, written) == [
        ("model.columns.length", '"Rain (mm)", and another column "length" in runs.csv')
    ]
    assert mistakes(text.replace("rain =", "status ="), runs, written) == [
        ("model.columns.status", '"status", which no variable can be called')
    ]


def test_a_fixed_input_with_other_values_in_the_file_is_refused(written):
    assert mistakes(STUDY + '[inputs]\nload = "1 kN"\n', "", written) == [("inputs.load", '"1 kN"')]


def test_designs_and_surrogates_that_do_not_fit_a_data_file_are_refused(written):
    design = '[designs.mc]\nkind = "monte-carlo"\nruns = 10\n'
    assert mistakes(STUDY + design, "", written) == [("designs.mc.kind", '"monte-carlo"')]
    assert mistakes(f"{STUDY}{DESIGN}first = 100\nlast = 201\n", "", written) == [
        ("designs.given.last", "201")
    ]
    surrogate = '[surrogates.pce]\nkind = "polynomial-chaos"\ndesign = "data"\n'
    assert mistakes(STUDY + surrogate, "", written) == [
        ("surrogates.pce", "a surrogate over inputs without a distribution")
    ]
    text = 'seed = 1\n[model]\nuse = "ishigami"\n[designs.given]\nkind = "data"\n[inputs]\n'
    found = mistakes(f"{text}x1 = 1\nx2 = 1\nx3 = 1\n", "", written)
    assert ("designs.given.kind", '"data" with a model that makes runs') in found


def test_a_replicate_has_a_whole_number(written):
    study = f'{STUDY}{DESIGN}follows = "sobol-sequence"\n'
    with pytest.raises(uqpen.StudyError) as caught:
        written(study, table(replicate=np.repeat([0, 0.5], 100)))
    reported = " ".join(str(caught.value).split())
    assert '0.5 in column "replicate", runs.csv, line 102' in reported
    assert "expected a whole number for each run: that of its replicate" in reported


def test_no_step_looks_at_all_columns_for_each_of_them(written, monkeypatch, tmp_path):
    """As an array, a variable takes time by the number of all variables; here in no loop."""
    made = 0
    construct = xr.Dataset._construct_dataarray

    def counted(self, name):
        nonlocal made
        made += 1
        return construct(self, name)

    def arrays_of(columns):
        nonlocal made
        made = 0
        values = {f"x{number}": LOADS[:20] for number in range(columns)}
        study = written(
            STUDY, pd.DataFrame({**values, "deflection": LOADS[:20]}).to_csv(index=False)
        )
        with monkeypatch.context() as patch:
            patch.setattr(xr.Dataset, "_construct_dataarray", counted)
            tree = uqpen.run(study)
            output_tables(tree)
            report_page(tree)
            uqpen.write(tree, tmp_path / "beam.nc")
            assert uqpen.verify(tmp_path / "beam.nc")
        return made

    # A page has charts of the first inputs.
    assert arrays_of(80) == arrays_of(40)
