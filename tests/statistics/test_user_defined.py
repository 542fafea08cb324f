"""A statistic from a file of the user's own: in an archive and all that is made of it."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.charts.source_comparison import compared_statistics
from uqpen.checkpoints.make_archive import make_archive
from uqpen.core.errors import StudyError
from uqpen.report.sections.sentences import output_sentences
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import output_tables
from uqpen.study.identity import run_fingerprint
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.verify import verify

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "extending" / "statistic.md").read_text(encoding="utf-8")
SPREAD, TRIMMED = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[:2]
KEY = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[0].strip()

RODS = (ROOT / "tests" / "data" / "rods.toml").read_text(encoding="utf-8").split("[inputs]")[1]
STUDY = f"""\
seed = 1
{KEY}
convergence = false
[model]
use = "rigid-penetration"
[inputs]{RODS}
[outputs.penetration_depth]
unit = "cm"
[designs.plain]
kind = "monte-carlo"
runs = 120
[designs.latin]
kind = "latin-hypercube"
runs = 60
[designs.steps]
kind = "one-at-a-time"
"""
# The same with few runs, and without the design that is no sample.
SMALL = STUDY.partition("[designs.latin]")[0].replace("120", "10")
BESIDE = """
import numpy as np
from uqpen.statistics.estimate import Estimate

FOUND = Estimate.without_bounds(1.0, "none")

def array(units="1", **attributes):
    return FOUND.to_array(units=units, long_name="a title").assign_attrs(attributes)

def along(dimension, *labels):
    found = Estimate.stack([FOUND] * 2, dimension, units="m2", long_name="along")
    return found.assign_coords({dimension: list(labels)}) if labels else found

def analysis(sample, quantity):
    YIELDS
"""
COUNTS = ("runs", "runs_used", "runs_inadmissible", "conditional_on")


def _write(folder, yields):
    (folder / "own.py").write_text(BESIDE.replace("YIELDS", yields))


def _study(text, folder):
    return uqpen.parse_study(
        text.replace("spread.py:interquartile_range", "own.py:analysis"), folder=folder
    )


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with the archive of a study, where the analysis is no longer."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "spread.py").write_text(SPREAD)
    (folder / "study.toml").write_text(STUDY)
    uqpen.write(uqpen.run(uqpen.load_study(folder / "study.toml")), folder / "a.nc")
    (folder / "spread.py").unlink()
    return folder


@pytest.fixture(scope="module")
def tree(made):
    return uqpen.open_archive(made / "a.nc")


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """The archive of a statistic with a record, where its function is no longer."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "trimmed.py").write_text(TRIMMED)
    text = STUDY.replace("spread.py:interquartile_range", "trimmed.py:trimmed_mean")
    uqpen.write(uqpen.run(uqpen.parse_study(text, folder=folder)), folder / "a.nc")
    (folder / "trimmed.py").unlink()
    return folder / "a.nc"


@pytest.fixture
def uqpen_beside(made, command_line):
    """The command line beside a copy of the archive alone."""
    Path("a.nc").write_bytes((made / "a.nc").read_bytes())
    return command_line


def _checks(path, **options):
    return {check.name: check for check in verify(path, **options)}


class TestInAnArchive:
    def test_it_is_what_the_runs_tell(self, tree):
        depths = tree["runs/plain"]["penetration_depth"].values
        found = tree["statistics/plain/penetration_depth"]["interquartile_range"]
        lower, upper = np.quantile(depths[np.isfinite(depths)], [0.25, 0.75])
        assert found.values[0] == upper - lower
        assert np.isnan(found.values[1:]).all()
        assert found.attrs["units"] == "m"

    def test_it_has_the_counts_of_runs_of_all_others(self, tree):
        group = tree["statistics/plain/penetration_depth"]
        found, mean = (group[name].attrs for name in ("interquartile_range", "mean"))
        assert found["runs_used"] < found["runs"] == 120
        assert {key: found[key] for key in COUNTS} == {key: mean[key] for key in COUNTS}

    def test_each_sample_has_it_and_no_other_design(self, tree):
        outputs = ("penetration_depth", "projectile_residue")
        for output in outputs:
            assert "trimmed_range" in tree[f"statistics/latin/{output}"]
        assert "interquartile_range" not in tree["statistics/steps/penetration_depth"]

    def test_its_file_is_kept(self, tree):
        assert tree["files"]["name"].values.tolist() == ["spread.py"]
        assert tree["files"]["content"].values.tolist() == [SPREAD]

    def test_it_decides_no_run(self, tmp_path):
        prints = []
        for number in range(2):
            _write(tmp_path, f"yield 'own', array(number={number})")
            prints.append(run_fingerprint(_study(STUDY, tmp_path), "", "plain"))
        assert (
            prints[0]
            == prints[1]
            == run_fingerprint(uqpen.parse_study(STUDY.replace(KEY, "")), "", "plain")
        )

    def test_runs_are_kept_when_it_fails(self, tmp_path):
        _write(tmp_path, "yield 'own', array() / 0 + None")
        with pytest.raises(StudyError, match="TypeError"):
            make_archive(_study(SMALL, tmp_path), tmp_path / "a.nc")
        assert list((tmp_path / "a.nc.parts").iterdir())
        _write(tmp_path, "yield 'own', array()")
        archive = make_archive(_study(SMALL, tmp_path), tmp_path / "a.nc")
        assert "own" in archive["statistics/plain/penetration_depth"]

    def test_it_sees_no_sample_without_runs(self, tmp_path):
        _write(tmp_path, "yield 'own', array(least=float(sample.values.min()))")
        text = f'{SMALL}[constraints]\nkeep = ["crater_radius > plasticity_radius"]\n'
        tree = uqpen.run(_study(text, tmp_path))
        assert not (tree["runs/plain"]["status"].values == 0).any()
        assert "own" not in tree["statistics/plain/penetration_depth"]


class TestShown:
    def test_in_the_table_in_the_output_s_unit(self, tree):
        table = next(output_tables(tree))
        assert table.title == "penetration_depth [cm]"
        labels = [label for label, _ in table.rows]
        ending = ["interquartile range", "trimmed range (trim=0.1) [m]"]
        assert labels[-3:-1] == ending
        cells = dict(table.rows)
        archived = tree["statistics/plain/penetration_depth"]
        in_cm = 100 * archived["interquartile_range"].values[0]
        assert cells["interquartile range"][0].split()[0] == f"{in_cm:.4g}"
        in_m = archived["trimmed_range"].values[1, 0]
        assert cells["trimmed range (trim=0.2) [m]"][0].split()[0] == f"{in_m:.4g}"

    def test_in_the_json(self, tree):
        reported = archive_json(tree)["designs"]["plain"]["outputs"]
        other = reported["penetration_depth"]["other"]
        archived = tree["statistics/plain/penetration_depth"]
        assert other["interquartile_range"] == {
            "estimate": archived["interquartile_range"].values[0],
            "lower": None,
            "upper": None,
            "interval": "none",
            "interval_label": "none",
            "note": "no interval was worked out",
            "units": "m",
            "long_name": "interquartile range",
        }
        assert list(other["trimmed_range"]) == ["0.1", "0.2"]
        assert other["trimmed_range"]["0.2"]["estimate"] == archived["trimmed_range"].values[1, 0]
        assert "other" not in reported["termination"]

    def test_on_the_page(self, uqpen_beside):
        assert uqpen_beside("report", "a.nc").code == 0
        page = Path("a.html").read_text(encoding="utf-8")
        row = re.search(r"<tr[^>]*>(?:(?!</tr>).)*interquartile range.*?</tr>", page, re.DOTALL)
        assert row is not None
        assert "trimmed range (trim=0.1) [m]" in page

    def test_in_the_long_table(self, tree):
        table = long_table(tree)
        table = table[(table["statistic"] == "trimmed_range") & (table["source"] == "latin")]
        table = table[table["output"] == "penetration_depth"]
        assert table["coordinates"].tolist() == ["trim=0.1", "trim=0.2"]
        assert table["unit"].tolist() == ["m", "m"]
        archived = tree["statistics/latin/penetration_depth"]["trimmed_range"].values[:, 0]
        assert table["estimate"].tolist() == archived.tolist()

    def test_of_a_category_and_along_two_dimensions(self, tmp_path):
        table = "Estimate.table([[FOUND] * 2], ('a', 'b'), units='1', long_name='both')"
        _write(tmp_path, f"yield 'own', {table}.assign_coords(a=['x'], b=[1, 2])")
        tree = uqpen.run(_study(SMALL, tmp_path))
        reported = archive_json(tree)["designs"]["plain"]["outputs"]["termination"]["other"]["own"]
        assert reported["x"]["2"]["estimate"] == 1
        tables = {table.title: table for table in output_tables(tree)}
        assert [label for label, _ in tables["termination"].rows][-2:] == [
            "both (a=x, b=1)",
            "both (a=x, b=2)",
        ]


class TestWithARecord:
    """A function with a record: its statistic stands where built-in ones do, without the file."""

    def test_it_stands_in_its_row(self, archive):
        tree = uqpen.open_archive(archive)
        labels = [label for label, _ in next(output_tables(tree)).rows]
        assert labels.index("trimmed mean") == labels.index("mean") + 1
        in_m = tree["statistics/plain/penetration_depth/trimmed_mean"].values[0]
        cells = dict(next(output_tables(tree)).rows)
        assert cells["trimmed mean"][0].split()[0] == f"{100 * in_m:.4g}"

    def test_it_is_stated_and_compared(self, archive):
        view = ArchiveView(uqpen.open_archive(archive), "")
        found = output_sentences(view, "penetration_depth", "plain")
        assert found is not None
        (sentence,) = (each for each in found.sentences if "extreme" in each)
        assert sentence.startswith("Without its extreme values, the mean of")
        assert "cm" in sentence
        assert "(without an interval: no interval was worked out)" in sentence
        compared = {each.label: each for each in compared_statistics(view, "penetration_depth")}
        assert [*compared["trimmed mean"].available_estimates] == ["plain", "latin"]

    @pytest.mark.parametrize("sentence", ["{estimate:>999999999}", "{output.__class__} {estimate}"])
    def test_the_words_of_an_archive_are_text_alone(self, archive, sentence):
        tree = uqpen.open_archive(archive).copy(deep=True)
        attributes = tree["statistics/plain/penetration_depth"]["trimmed_mean"].attrs
        attributes["shown_sentence"] = sentence
        found = output_sentences(ArchiveView(tree, ""), "penetration_depth", "plain")
        assert found is not None
        stated = next(each for each in found.sentences if each.startswith(sentence[:9]))
        assert stated.startswith(sentence.partition(" ")[0])
        attributes.update(shown_row="many", shown_rank=1e300, shown_label="\x1b[31m<b>{entry:>9}")
        labels = [label for label, _ in next(output_tables(tree)).rows]
        assert [label for label in labels if "{entry:>9}" in label] == [r"\x1b[31m<b>{entry:>9}"]

    @pytest.mark.parametrize(
        ("record", "found", "expected"),
        [
            ("3", "a record of type int", "Statistic, or several"),
            ("Statistic('mean', 'x')", "a record of 'mean'", "no other statistic has"),
            ("Statistic('bound', 'x')", "a record of 'bound'", "do not use themselves"),
            ("[Statistic('own', 'x', shown=Shown('x'))] * 2", "a record of 'own'", "no other"),
            ("Statistic('own', 'x')", "with too few words", "a label, and a sentence"),
            ("Statistic('own', 'x', shown=Shown(3))", "with label 3", "a text"),
            ("Statistic('own', 'x', shown=Shown('x', 'y'))", "with row 'y'", "a whole number"),
            ("Statistic('own', 'x', shown=Shown('{x}'))", "the word {x} in its label", "{entry}"),
            ("Statistic('own', 'x', ('a', 'b'), shown=Shown('x'))", "more dimensions", "one"),
            ("Statistic('own', 'x', group='m', shown=Shown('x'))", "built-in", "name, title"),
        ],
    )
    def test_a_wrong_one_is_reported_before_any_run(self, tmp_path, record, found, expected):
        text = f"""yield
from uqpen.core.statistic import Shown, Statistic
analysis.record = {record}
"""
        _write(tmp_path, text)
        with pytest.raises(StudyError) as raised:
            _study(SMALL, tmp_path)
        (problem,) = raised.value.problems
        assert found in problem.found
        assert expected in problem.expected

    def test_a_result_unlike_its_record_is_reported(self, tmp_path):
        text = """yield 'own', array('m2')
from uqpen.core.statistic import Shown, Statistic
analysis.record = Statistic('own', 'x', shown=Shown('x'))
"""
        _write(tmp_path, text)
        with pytest.raises(StudyError, match="own in m2"):
            uqpen.run(_study(SMALL, tmp_path))


class TestTrust:
    """Code that an archive names is executed only on demand."""

    def test_without_it_all_the_rest_is_verified(self, made):
        checks = _checks(made / "a.nc", runs=None)
        assert checks["analyses"].verdict is CheckOutcome.UNCHECKED
        assert "not checked: interquartile_range, trimmed_range;" in checks["analyses"].text
        assert "(spread.py:interquartile_range)" in checks["analyses"].text
        others = [check.verdict for name, check in checks.items() if name != "analyses"]
        assert others == [CheckOutcome.EQUAL] * len(others)
        assert {"runs", "statistics"} <= checks.keys()

    def test_with_it_they_are_repeated(self, made):
        checks = _checks(made / "a.nc", trust=True)
        assert "analyses" not in checks
        assert {check.verdict for check in checks.values()} == {CheckOutcome.EQUAL}

    def test_what_it_did_not_yield_is_reported(self, made, tmp_path):
        groups = uqpen.open_archive(made / "a.nc").to_dict()
        path = "/statistics/plain/penetration_depth"
        for name, trusted in (("interquartile_range", True), ("mean", False)):
            changed = groups[path].copy(deep=True)
            changed[name].values[0] += 1
            tree = xr.DataTree.from_dict({**groups, path: changed})
            uqpen.write(tree, tmp_path / "changed.nc")
            checks = _checks(tmp_path / "changed.nc", trust=trusted)
            assert checks["statistics"].verdict is CheckOutcome.DIFFERENT
            assert f"{path}: {name}: " in checks["statistics"].details[0]

    def test_it_is_never_executed_without(self, tmp_path, command_line):
        trace = tmp_path / "executed"
        (tmp_path / "own.py").write_text(
            f"import pathlib\npathlib.Path({str(trace)!r}).touch()\n"
            + BESIDE.replace("YIELDS", "yield 'own', array()")
        )
        study = _study(SMALL, tmp_path)
        uqpen.write(uqpen.run(study), tmp_path / "a.nc")
        trace.unlink()
        commands = (["show"], ["verify"], ["report"], ["diff", "a.nc"], ["rerun"])
        outcomes = [command_line(*command, "a.nc") for command in commands]
        assert [done.code for done in outcomes] == [0, 0, 0, 0, 2], outcomes
        assert not trace.exists()
        assert "own.py:analysis" in outcomes[-1].err
        assert "--trust" in outcomes[-1].err
        assert command_line("rerun", "a.nc", "--trust").code == 0
        assert trace.exists()

    def test_with_it_the_study_is_repeated(self, uqpen_beside):
        assert uqpen_beside("rerun", "a.nc", "--trust").code == 0
        assert Path("a_rerun.nc").read_bytes() == Path("a.nc").read_bytes()

    def test_one_that_fails_now_is_reported(self, uqpen_beside):
        Path("spread.py").write_text("def interquartile_range(sample, quantity):\n    1 / 0\n")
        done = uqpen_beside("verify", "a.nc", "--trust", "--folder", ".")
        assert done.code == 4
        assert "an analysis that its study names fails" in done.out
        assert "ZeroDivisionError: division by zero (line 2)" in done.said


class TestMistakesInTheStudy:
    @pytest.mark.parametrize(
        ("value", "key", "found", "expected"),
        [
            ('"own.py:analysis"', "analyses", '"own.py:analysis"', "a list in square brackets"),
            ("[1]", "analyses[0]", "1", 'a function such as "spread.py:interquartile_range"'),
            ('["own.py:other"]', "analyses[0]", 'has no function "other"', "a function that"),
            ('["other.py:f"]', "analyses[0]", 'no file "other.py" beside', "a function that"),
            ('["no_such.module:f"]', "analyses[0]", "No module named", "a module no_such"),
            ('["own.py"]', "analyses[0]", "is not of the form", "a function that"),
            ('["own.py:analysis", "own.py:few"]', "analyses[1]", "few(sample)", "a sample and a"),
            (
                '["own.py:analysis", "own.py:analysis"]',
                "analyses[1]",
                "again",
                "each function once",
            ),
        ],
    )
    def test_is_reported_with_line_key_found_and_expected(
        self, tmp_path, value, key, found, expected
    ):
        _write(tmp_path, "yield\ndef few(sample):\n    yield\n")
        with pytest.raises(StudyError) as raised:
            uqpen.parse_study(STUDY.replace(KEY, f"analyses = {value}"), folder=tmp_path)
        assert f"study.toml:2  {key}\n" in str(raised.value)
        (problem,) = raised.value.problems
        assert found in problem.found
        assert expected in problem.expected


@pytest.mark.parametrize(
    ("yields", "found", "expected"),
    [
        ("yield 'mean', array()", "'mean'", "no built-in statistic has"),
        ("yield 'a b', array()", "'a b'", "letters, digits and _"),
        ("yield 3, array()", "the statistic 3", "letters, digits and _"),
        ("yield 'bound', array()", "'bound'", "archives do not use themselves"),
        ("yield 'a_interval', array()", "'a_interval'", "archives do not use themselves"),
        ("yield 'a', array(); yield 'a', array()", "'a'", "not yielded before"),
        ("yield array()", "of type DataArray", "a name and an estimate array"),
        ("return [3.0]", "of type float", "a name and an estimate array"),
        ("return 3.0", "TypeError", "statistics"),
        ("sample.values.sort()", "read-only (line 15)", "statistics"),
        ("import os; raise SystemExit(3)", "SystemExit: 3", "statistics"),
        ("yield 'a', 3.0", "a of type float", "an estimate array"),
        ("yield 'a', array()[:2]", "without estimate, lower, upper", "an estimate array"),
        ("yield 'a', array().drop_vars('note')", "without texts note", "an estimate array"),
        ("yield 'a', array().drop_attrs()", "without units", "an estimate array"),
        ("yield 'a', array('parsec')", "", ""),
        ("yield 'a', array('frobs')", "units that are none", "an estimate array"),
        ("yield 'a', array(unit_rule='none')", "unit_rule 'none'", "an estimate array"),
        ("yield 'a', array(more=None)", "attribute 'more'", "an estimate array"),
        ("yield 'a', array(order='x')", "order is no number", "an estimate array"),
        ("yield 'a', along('d')", "a dimension d", "a coordinate along it"),
        ("yield 'a', along('d', 1, 1)", "a dimension d", "a coordinate along it"),
        ("yield 'a', along('run', 1, 2)", "'run'", "archives do not use themselves"),
        ("yield 'a', along('kind', 1, 2)", "'kind'", "archives do not use themselves"),
        ("yield 'a', along('probability', 0.1, 0.2)", "another probability", "the same"),
        ("yield 'a', along('threshold', 'x', 'y')", "a dimension threshold", "built-in"),
        ("yield 'a', along('input', 0, 1)", "another input", "the same, or another"),
        (
            "yield 'a', along('d', 1, 2); yield 'b', along('d', 1, 3)",
            "b with another d",
            "the same, or another",
        ),
        ("yield 'a', array(); yield 'b', along('a', 1, 2)", "a is a statistic", "an estimate"),
    ],
)
def test_what_it_must_not_yield_is_reported(tmp_path, yields, found, expected):
    _write(tmp_path, yields)
    study = _study(SMALL, tmp_path)
    if not found:
        uqpen.run(study)
        return
    with pytest.raises(StudyError) as raised:
        uqpen.run(study)
    (problem,) = raised.value.problems
    assert problem.found.startswith("own.py:analysis of penetration_depth: ")
    assert found in problem.found
    assert expected in problem.expected
