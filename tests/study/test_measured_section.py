"""``[measured]``: each mistake with its key, what was found and what is expected."""

import pytest

from tests.test_measurements import LINE, MODEL
from uqpen.core.errors import StudyError
from uqpen.study.load import parse_study
from uqpen.study.measured_section import role_lines


def refused(tmp_path, text):
    (tmp_path / "line.py").write_text(MODEL)
    with pytest.raises(StudyError) as caught:
        parse_study(text, folder=tmp_path)
    return [str(each) for each in caught.value.problems]


TABLE = "x = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unknown = ["a", "b"]', 'unknown = ["a"]', "found nothing of b; expected each among cond"),
        ('unknown = ["a", "b"]', 'unknown = ["a", "b"]\nfixed = ["a"]',
         "line.fixed: found a, which is among unknown, too"),
        ('unknown = ["a", "b"]', 'unknown = ["a", "c"]',
         'line.unknown: found "c"; expected an input of'),
        ('unknown = ["a", "b"]', 'unknown = ["a"]\nconditions = ["b"]',
         'found no column "b" in its file'),
        ('correlation = "none"', "", "y.correlation: found nothing; expected { x ="),
        ('correlation = "none"', "correlation = { t = 3 }",
         "correlation: found a table; expected { x ="),
        ("std = 0.2", "", "y.std: found nothing; expected the standard deviation of an error"),
        ("std = 0.2", "std = 0", "y.std: found 0; expected a standard deviation above 0"),
        ("std = 0.2", 'std = "sdd"', 'y.std: found "sdd"; expected the standard deviation'),
        ("std = 0.2", "std = []", "y.std: found an empty list; expected the standard deviation"),
        (f"{TABLE}\n[measured.line.y]\nstd = 0.2",
         f'{TABLE}\nsize = [1, 1, 1, 1]\n[measured.line.y]\nstd = "sizes"',
         'y.std: found "sizes"; expected did you mean the column "size"? or the standard dev'),
        ("std = 0.2", 'std = 0.2\nat_least = "z"',
         'y.at_least: found "z"; expected a column of 0 and 1: 1 where the entry is a bound; kno'),
        ("std = 0.2", "covariance = 3", "y.covariance: found 3; expected a file of 4 columns with "
         "4 rows, headed 1 to 4 with the square of their unit, such as 1 ["),
        ("std = 0.2", 'std = "repeats"',
         'y.std: found "repeats" with 0 repeats; expected at least 5'),
        (f"{TABLE}\n[measured.line.y]\nstd = 0.2",
         'x = [0, 0, 1, 1]\ny = [1, 2, 3, 4]\n[measured.line.y]\nstd = "repeats"',
         'y.std: found "repeats" with 2 repeats; expected at least 5'),
        (f"[measured.line.table]\n{TABLE}", "file = 3", "line.file: found 3; expected the name of"),
        (f"[measured.line.table]\n{TABLE}", "table = 3", "line.table: found 3; expected a table"),
        (TABLE, 'x = ["a", 1]\ny = [1, "b"]',
         'line.table: found column "x": found "a", expected a number; expected rows of'),
        (TABLE, "x = []\ny = []", "line.table: found 0 rows; expected 1 to 5000 rows of"),
        (f"[measured.line.table]\n{TABLE}", 'experiment = "rig"\ntable = { x = [0], y = [1] }',
         'line.experiment: found "rig"; expected a column'),
        ("std = 0.2", 'std = 0.2\nat_least = "x"',
         'y.at_least: found "x"; expected a column of 0 and 1'),
        ("std = 0.2", 'std = 0.2\nshared = { std = 1, group = "rg" }',
         'shared.group: found "rg"; expected a column'),
        ("std = 0.2", 'covariance = "none.csv"', "y.covariance: found there is no file"),
        ("std = 0.2", "std = 0.2\nstdd = 3", "y.stdd: found an unknown key; "
         'expected did you mean "std"? known: std, shared, correlation, covariance, discrepancy, '
         "column, at_least, at_most"),
        ("std = 0.2", 'std = 0.2\nshared = { std = 1, grup = "x" }',
         'shared.grup: found an unknown key; expected did you mean "group"? known: std, group'),
        ("std = 0.2", 'std = 0.2\ndiscrepancy = { along = "z" }',
         'discrepancy.along: found "z"; expected a condition or a dimension of y: x'),
        ("std = 0.2", 'std = 0.2\ndiscrepancy = { along = "x" }',
         "discrepancy.length: found nothing; expected the length over which it changes"),
        ("std = 0.2",
         'std = 0.2\ndiscrepancy = { along = "x", std = 1, length = { half-normal = 1 } }',
         "discrepancy.std: found 1; expected its standard deviation, known up to a prior"),
        ("std = 0.2",
         'std = 0.2\ndiscrepancy = { along = "x", std = { half-normal = 1, mean = 2 }, '
         "length = { half-normal = 1 } }",
         "discrepancy.std: found a table; expected its standard deviation, known up to a prior"),
        ("std = 0.2", 'std = 0.2\ndiscrepancy = { along = "x", std = { half-normal = 1 }, '
         "length = { half-normal = 1 } }",
         "fit.measured: found a discrepancy, which takes up whatever the unknowns do not"),
        ("x = [0, 1, 2, 3]", "x = [0, 1, 2, 7]",
         "found x 7 1 in row 4; expected places from 0 to 5"),
        ("x = [0, 1, 2, 3]", f"x = [0, 1, 2, {10**25}]",
         "found x 1e+25 1 in row 4; expected places from 0 to 5"),
        ("x = [0, 1, 2, 3]", "x = [0, 1, 2]", "line.table: found its columns differ in length"),
        ("[measured.line.y]", "[measured.line.z]",
         "line.z: found an unknown key or output of the model; expected known: y, source, "
         "experiment, file, table, conditions, unknown"),
        ("[measured.line.y]", "[measured.line.z]",
         "measured.line: found no output; expected a table [measured.line.<output>]; outputs: y"),
        (f"[measured.line.table]\n{TABLE}\n[measured.line.y]\nstd = 0.2",
         'y = 3\n[measured.line.table]\nx = [0]\ny = [1]',
         "line.y: found 3; expected a table"),
        (f"[measured.line.table]\n{TABLE}", 'file = "a.csv"\ntable = { x = [0], y = [1] }',
         "line.file: found file beside table; expected one of both"),
        ('unknown = ["a", "b"]', 'unknown = ["a", "b"]\nhold_out = [2, 5]',
         "measured.line.hold_out[1]: found 5; expected the number of a row, 1 to 4; or a label"),
        ('unknown = ["a", "b"]', 'unknown = ["a", "b"]\nexperiment = "x"\nhold_out = [7]',
         'line.hold_out[0]: found 7; expected an entry of column "x"'),
        ('unknown = ["a", "b"]', 'unknown = ["a", "b"]\nhold_out = [1, 2, 3, 4]',
         "line.hold_out: found all values of y; expected at least one that a fit learns from"),
        (f'unknown = ["a", "b"]\n[measured.line.table]\n{TABLE}',
         'unknown = ["a", "b"]\nhold_out = [2]\n[measured.line.table]\n'
         'x = [0, 1, 2, 3]\ny = [1.1, "", 5.2, 6.8]',
         "line.hold_out: found row 2, in which nothing was measured; expected rows with a"),
        (
            f'unknown = ["a", "b"]\n[measured.line.table]\n{TABLE}\n[measured.line.y]\nstd = 0.2',
            f'unknown = ["a", "b"]\nhold_out = [2]\n[measured.line.table]\n{TABLE}\n'
            "[measured.line.y]\nstd = 0.2\nshared = { std = 1 }",
            "line.hold_out: found rows whose errors of y depend on those of rows that are left; "
            "expected all rows that share an error, or none of them",
        ),
        ('unknown = ["a", "b"]', 'unknown = ["a"]\nvaries = ["b"]\nhold_out = [2]',
         "line.hold_out: found a part of an experiment, which has an input with a value of its "
         "own; expected whole experiments"),
        ('unknown = ["a", "b"]', 'unknown = ["a", "b"]\nhold_out = [2]',
         "fit.measured: found rows that are held out, which a posterior alone is compared with; "
         'expected kind = "posterior"; or two sections of measurements'),
        ('measured = ["line"]', 'measured = ["lime"]',
         'fit.measured: found "lime"; expected a [measured.<name>]'),
        ('kind = "least-squares"\nmeasured = ["line"]', 'kind = "saltelli"\nbase = 64\nat = "line"',
         "fit.at: found runs at experiments of a design that is no sample"),
        ('measured = ["line"]', 'measured = ["line"]\nrepeats = 2',
         "fit.repeats: found repeats of runs at experiments"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_before_any_run(tmp_path, old, new, message):
    assert old in LINE
    assert any(message in each for each in refused(tmp_path, LINE.replace(old, new)))


def test_a_column_of_an_input_is_not_passed_over(tmp_path):
    text = LINE.replace('["a", "b"]', '["a"]').replace(TABLE, f"{TABLE}\nb = [1, 1, 2, 2]")
    text = text.replace("b = { normal = { mean = 0, std = 10 } }", "b = 1")
    assert refused(tmp_path, text) == [
        'measured.line.conditions: found a column "b" that no key names; expected b among the '
        'conditions; or fixed = ["b"], not to use the column'
    ]
    parse_study(text.replace('unknown = ["a"]', 'unknown = ["a"]\nfixed = ["b"]'), folder=tmp_path)


def test_one_mistake_in_the_measurements_is_one_message(tmp_path):
    assert len(refused(tmp_path, LINE.replace("std = 0.2", "std = 0"))) == 1
    assert len(refused(tmp_path, LINE.replace("line.py:line", "line.py:lin"))) == 1
    for more in ("shared = 1", "discrepancy = 1"):
        assert len(refused(tmp_path, LINE.replace("std = 0.2", f"std = 0.2\n{more}"))) == 1
    with_column = LINE.replace(TABLE, f"{TABLE}\nb = [1, 1, 2, 2]").replace('["a", "b"]', '["a"]')
    for more in ('conditions = "b"', 'condition = ["b"]'):
        text = with_column.replace('unknown = ["a"]', f'unknown = ["a"]\n{more}')
        assert len(refused(tmp_path, text)) == 1


def test_each_input_is_listed_with_its_role(tmp_path):
    (tmp_path / "line.py").write_text(MODEL)
    found = list(role_lines(parse_study(LINE, folder=tmp_path)))
    assert found == ["measured line: 1 experiment, 4 values; unknown a, b"]


def test_labels_of_a_file_name_the_rows_that_are_held_out(tmp_path):
    (tmp_path / "line.py").write_text(MODEL)
    (tmp_path / "shots.csv").write_text("x,y,shot\n0,1.1,B7\n1,2.9,3\n2,5.2,A1\n3,6.8,3\n")
    text = LINE.replace(f"[measured.line.table]\n{TABLE}\n", "").replace(
        "least-squares", "posterior"
    )
    for written, lines in (('["A1", 3]', [2, 3, 4]), ('["B7", "B7"]', [1])):
        section = f'file = "shots.csv"\nexperiment = "shot"\nhold_out = {written}\nunknown'
        study = parse_study(text.replace("unknown", section, 1), folder=tmp_path)
        (found,) = (each.left_out for each in study.measured.values())
        assert found.outputs[0].lines.tolist() == lines
        rows = f"{len(lines)} row{'s' * (len(lines) > 1)} held out"
        assert next(role_lines(study)).split("; ")[1] == rows
