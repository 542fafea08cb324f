"""Data files: every format gives the same columns, and each mistake has a place."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from uqpen.core.errors import SettingsError
from uqpen.models.data.data_file import data_file, read_data_file

RUNS = Path(__file__).parents[1] / "data" / "runs"


def file_of(text, name="runs.csv"):
    return data_file(Path(name), text.encode())


def refused(text):
    with pytest.raises(SettingsError) as caught:
        [column.numbers() for column in file_of(text).columns]
    (problem,) = caught.value.problems
    return problem.found, problem.expected


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_the_delimiter_is_recognised(delimiter):
    file = file_of(f'"a [kN]"{delimiter}b\r\n1{delimiter}2\r\n\r\n3{delimiter}"4"\r\n')
    assert [(column.name, column.unit) for column in file.columns] == [("a", "kN"), ("b", "")]
    assert [column.numbers().tolist() for column in file.columns] == [[1, 3], [2, 4]]


def test_a_unit_stands_in_brackets_of_either_kind():
    columns = file_of("Rain (mm),flux (kg/(m2 s)),T (min),T (max),max(q) [m]\n1,2,3,4,5\n").columns
    assert [(column.name, column.unit) for column in columns] == [
        ("Rain", "mm"),
        ("flux", "kg/(m2 s)"),
        ("T (min)", ""),
        ("T (max)", ""),
        ("max(q)", "m"),
    ]


@given(st.lists(st.tuples(*[st.floats(allow_nan=False)] * 3), min_size=1))
def test_every_number_is_read_to_the_bit(rows):
    lines = ["a,b,c", *(",".join(map(repr, row)) for row in rows)]
    read = np.transpose([column.numbers() for column in file_of("\n".join(lines)).columns])
    assert np.array_equal(read, np.array(rows))


def test_a_table_of_openturns_is_read():
    file = read_data_file(RUNS / "openturns.csv")
    assert [column.name for column in file.columns] == ["E", "F", "L", "I", "deviation"]
    E, F, L, moment, deviation = (column.numbers() for column in file.columns)
    assert deviation == pytest.approx(F * L**3 / (3 * E * moment), rel=1e-14)
    assert file.rows == 60


def test_a_collation_of_easyvvuq_is_read_without_its_numbering():
    file = read_data_file(RUNS / "easyvvuq.csv")
    names = ["F", "L", "I", "E", "deflection", "stress_0", "stress_1"]
    assert [column.name for column in file.columns] == names
    F, L, moment, E, deflection, first, second = (column.numbers() for column in file.columns)
    assert deflection == pytest.approx(F * L**3 / (3 * E * moment), rel=1e-14)
    assert first == pytest.approx(F * L / moment, rel=1e-14)
    assert np.array_equal(second, F)
    assert file.columns[0].place(0) == "easyvvuq.csv, line 3"
    without_places = file_of("run_id,iteration,F\n1,0,3.5\n2,0,4.5\n")
    assert [column.numbers().tolist() for column in without_places.columns] == [[3.5, 4.5]]


def test_a_tabular_file_of_dakota_is_read_without_its_numbering():
    file = read_data_file(RUNS / "dakota.dat")
    columns = {column.name: column.numbers() for column in file.columns}
    assert list(columns) == ["w", "t", "X", "Y", "mass", "stress", "displacement"]
    assert columns["mass"] == pytest.approx(2.8 * columns["w"] * columns["t"], rel=1e-8)
    without_numbering = file_of("%  x  y \n 1 2 \n 3 4 \n")
    assert [column.numbers().tolist() for column in without_numbering.columns] == [[1, 3], [2, 4]]


@pytest.mark.parametrize("heading", ["%eval_id x y", "% eval_id x y", "%interface x y"])
def test_dakota_may_leave_out_a_column_of_its_numbering(heading):
    row = "I1 2 3" if "interface" in heading else "1 2 3"
    columns = file_of(f"{heading}\n{row}\n").columns
    assert {column.name: column.numbers().tolist() for column in columns} == {"x": [2], "y": [3]}


ROWS = "%eval_id interface x y\n1 NO_ID 0.1 5\n2 NO_ID 0.2 6\n\n2 NO_ID 0.2 6\n3 NO_ID 0.4 7\n"


def test_a_run_of_dakota_that_stands_twice_is_refused():
    assert refused(ROWS) == (
        "eval_id 2 twice in runs.csv, lines 3 and 5, with equal values",
        "each run once: remove one of the lines",
    )
    assert refused(ROWS.replace("0.2 6\n\n", "0.3 6\n\n")) == (
        "eval_id 2 twice in runs.csv, lines 3 and 5, with other values",
        "a number for each run: number them anew if they are of several studies",
    )
    assert file_of(ROWS.replace("\n\n2", "\n\n5")).rows == 4  # the same point, another run


def test_runs_of_several_interfaces_of_dakota_are_those_of_several_models():
    assert refused(ROWS.replace("\n2 NO_ID", "\n2 COARSE")) == (
        "the interfaces NO_ID and COARSE in runs.csv, lines 2 and 3",
        "runs of one interface: keep the lines of one",
    )


def test_a_run_of_easyvvuq_that_stands_twice_is_refused():
    text = ",run_id,iteration,x,y\n,0,0,0,0\n0,1,0,2,3\n1,1,1,2,4\n2,1,0,2,5\n"
    assert refused(text)[0] == (
        "run_id 1, iteration 0 twice in runs.csv, lines 3 and 5, with other values"
    )
    assert file_of(text.replace("2,1,0", "2,2,0")).rows == 3


def test_netcdf_and_csv_give_the_same(tmp_path):
    xr.Dataset(
        {"a": ("run", [1.0, 2.5], {"units": "kN"}), "y": ("run", [np.nan, 3.0]),
         "status": ("run", ["failed", "ok"])},
        {"run": [0, 1]},
    ).to_netcdf(tmp_path / "runs.nc")  # fmt: skip
    read = read_data_file(tmp_path / "runs.nc")
    for one, other in zip(
        read.columns, file_of("a [kN],y,status\n1,,failed\n2.5,3,ok\n").columns, strict=True
    ):
        assert (one.name, one.unit, one.texts()) == (other.name, other.unit, other.texts())


def test_parquet_and_csv_give_the_same(tmp_path):
    pytest.importorskip("pyarrow", reason="pandas reads Parquet with pyarrow")
    pd.DataFrame({"a [kN]": [1.0, 2.5], "y": [np.nan, 3.0]}).to_parquet(tmp_path / "runs.parquet")
    read = read_data_file(tmp_path / "runs.parquet")
    assert [(column.name, column.unit, column.texts()) for column in read.columns] == [
        ("a", "kN", ["1", "2.5"]),
        ("y", "", ["", "3"]),
    ]


def test_excel_and_csv_give_the_same(tmp_path):
    pytest.importorskip("openpyxl", reason="pandas reads Excel with openpyxl")
    rows = {"Rain (mm)": [1.0, None, 2.5], "soil": ["clay", None, "sand"]}
    pd.DataFrame(rows).to_excel(tmp_path / "runs.xlsx", index=False)
    read = read_data_file(tmp_path / "runs.xlsx")
    assert [(column.name, column.unit, column.texts()) for column in read.columns] == [
        ("Rain", "mm", ["1", "2.5"]),
        ("soil", "", ["clay", "sand"]),
    ]
    assert read.columns[0].place(1) == "runs.xlsx, row 4"
    with pytest.raises(SettingsError, match="an Excel file"):
        file_of("a,b", "runs.xlsx")


def test_excel_without_its_package_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(SettingsError, match=r"pip install uqpen\[excel\], or a CSV file"):
        file_of("", "runs.xlsx")


@pytest.mark.parametrize("blank", ["", " ", "nan", "NaN", "NA", "null"])
def test_a_blank_entry_is_no_number(blank):
    (_, column) = file_of(f"a,b\n1,2\n3,{blank}\n").columns
    assert np.array_equal(column.numbers(), [2, np.nan], equal_nan=True)
    assert column.texts() == ["2", ""]


def test_rows_without_an_entry_are_no_runs():
    file = file_of("a,b\n1,2\n,\n  \n3,x\n,\n")
    assert file.rows == 2
    assert file.columns[1].place(1) == "runs.csv, line 5"


def test_mistakes_are_said_with_their_place():
    assert refused('a,b\n1,2\n\n"3\n4",x\n')[0] == '"3\\n4" in column "a", runs.csv, line 5'
    assert refused("a,b\n1,2\n\n3,x\n") == ('"x" in column "b", runs.csv, line 4', "a number")
    assert refused("a,b\n1,2\n3\n") == ("1 value in runs.csv, line 3", "2, one under each heading")
    assert refused("a,b\n1,2,3\n")[0] == "3 values in runs.csv, line 2"
    assert refused("a,a [kN]\n1,2\n")[0] == 'two columns "a" in runs.csv'
    assert refused("a [kN,b\n1,2\n")[0] == 'the heading "a [kN" in runs.csv'
    assert refused("a,b\n")[0] == "no row in runs.csv"
    assert refused("%eval_id interface x y\n")[0] == "no row in runs.csv"
    assert refused("")[0] == "no headings in runs.csv"
    assert refused("% x y\n1 2 3\n")[0] == "3 values in runs.csv, line 2"


def test_what_is_no_table_is_refused(tmp_path):
    for name, content, found in (
        ("a.csv", b"a,b\n1,\xff\n", "bytes that are no UTF-8 in a.csv, line 2"),
        ("a.nc", b"not NetCDF", "a.nc, which cannot be read as NetCDF: it is no NetCDF file"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(SettingsError, match=found):
            read_data_file(tmp_path / name)
    with pytest.raises(SettingsError, match="no file"):
        read_data_file(tmp_path / "absent.csv")
