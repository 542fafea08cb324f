"""Columns of a CSV file: headings and numbers of any length are answered."""

import pytest

from uqpen.core.columns import read_columns
from uqpen.core.errors import TableError

HUNDRED_THOUSAND = 100_000  # the reader of CSV takes no more than 131 072 characters at once


def columns(folder, text):
    (folder / "table.csv").write_text(text)
    read = read_columns(folder / "table.csv").columns
    return [(column.name, column.unit, column.load().tolist()) for column in read]


def test_a_heading_has_a_name_and_perhaps_a_unit(tmp_path):
    text = " a , b [m] ,c[ ],d [ g/cm^3 ] \n1,2.5, 3 ,4e1\n"
    found = [("a", "1", [1]), ("b", "m", [2.5]), ("c", "1", [3]), ("d", "g/cm^3", [40])]
    assert columns(tmp_path, text) == found


@pytest.mark.parametrize("heading", ["[m]", "a [m", "a m]", "a [b] c", "a [[m]]", "a [b] [m]", "]"])
def test_another_heading_is_shown(tmp_path, heading):
    with pytest.raises(TableError) as refused:
        columns(tmp_path, f"{heading}\n1\n")
    reported = f'"table.csv": heading "{heading}" is not of the form "name [unit]"'
    assert str(refused.value) == reported


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a [m];b\n1;2\n", " seems to be separated by semicolons"),
        ("a;b\n1,5;2,5\n", " seems to be separated by semicolons"),
        ("a [m]\tb\n1\t2\n", " seems to be separated by tabs"),
    ],
)
def test_another_mark_between_columns_is_named(tmp_path, text, found):
    with pytest.raises(TableError) as refused:
        columns(tmp_path, text)
    expected = "; expected commas between columns, and points before decimals"
    assert str(refused.value) == f'"table.csv"{found}{expected}'


def test_a_semicolon_in_a_heading_separates_nothing(tmp_path):
    assert columns(tmp_path, "stress; max [MPa]\n1\n") == [("stress; max", "MPa", [1])]
    assert columns(tmp_path, "a; b,c\n1,2\n") == [("a; b", "1", [1]), ("c", "1", [2])]


def test_decimal_commas_make_too_many_values(tmp_path):
    with pytest.raises(TableError, match="line 2: 4 values under 2 headings; commas separate "
                       "columns, and a point stands before decimals"):  # fmt: skip
        columns(tmp_path, "a,b\n1,5,2,5\n")


@pytest.mark.parametrize(
    ("start", "end"), [("a", "["), ("a", "x ]["), ("[", "x"), ("a [m]", "x"), ("", "x")]
)
def test_a_heading_that_is_far_too_long_is_refused(tmp_path, start, end):
    heading = start + " " * HUNDRED_THOUSAND + end
    reported = f"found a heading of {len(heading)} characters, expected at most 1000"
    with pytest.raises(TableError, match=reported):
        columns(tmp_path, f"{heading}\n1\n")


def test_a_number_that_is_far_too_long_is_refused(tmp_path):
    with pytest.raises(TableError) as refused:
        columns(tmp_path, f"a\n1\n{'1' * HUNDRED_THOUSAND}x\n")
    found = "found 100001 characters, expected a number"
    assert str(refused.value) == f'"table.csv", line 3, column "a": {found}'


def test_entries_are_read_by_parts_up_to_the_first_that_is_no_number(tmp_path, monkeypatch):
    monkeypatch.setattr("uqpen.core.columns._ROWS", 2)
    rows = [f"{each},{each}" for each in range(5)]
    text = "\n".join(["a,note", *rows[:3], "", *rows[3:], "5,x", "6,y"])
    (tmp_path / "table.csv").write_text(text)
    a, note = read_columns(tmp_path / "table.csv").columns
    assert a.load().tolist() == [*range(7)]
    assert a.values("1").tolist() == [*range(7)]
    with pytest.raises(TableError, match='line 8, column "note": found "x", expected a number'):
        note.load()
