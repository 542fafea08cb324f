"""Responses of and to quantities in units with an offset, whose per cent have no meaning."""

import numpy as np
import pytest

import uqpen
from uqpen.figures.page import panels
from uqpen.report.blocks import find_charts
from uqpen.report.sections.outputs import sensitivity
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables

SOURCE = """
def cool(flow, inlet, ambient):
    warm = inlet - ambient
    return {"duty": 4.0 * flow * warm, "wall": ambient + 0.25 * warm + 0.1 * flow}
"""
STUDY = """
seed = 1
[model]
python = "cooler.py:cool"
vectorized = true
[model.inputs]
flow = "kg/s"
inlet = "{unit}"
ambient = "{unit}"
[model.outputs]
duty = "kW"
wall = "{unit}"
[inputs]
flow = "({flow} ± 0.5) kg/s"
inlet = "({inlet} ± 2) {unit}"
ambient = "({ambient} ± 4) {unit}"
[designs.steps]
kind = "one-at-a-time"
"""
REASON = "no per cent, as the zero of degC is arbitrary"


def study(folder, unit, inlet, ambient, flow=5):
    (folder / "cooler.py").write_text(SOURCE)
    text = STUDY.replace("{unit}", unit).format(inlet=inlet, ambient=ambient, flow=flow)
    return uqpen.run(uqpen.parse_study(text, folder=folder))


@pytest.fixture(scope="module")
def celsius(tmp_path_factory):
    return study(tmp_path_factory.mktemp("celsius"), "degC", 90, 30)


def tables(tree):
    return {table.title: table for table in output_tables(tree)}


def charts(tree):
    return list(find_charts(sensitivity(ArchiveView(tree, ""))))


def test_no_table_has_per_cent_of_a_temperature(celsius):
    table = tables(celsius)["duty: responses to its inputs"]
    rows = dict(table.rows)
    assert rows["flow"][0].startswith("100")
    assert rows["inlet"][0] == rows["ambient"][0] == "– ²"
    assert table.notes[1] == REASON
    # With its uncertainty a response has a meaning: 2 of 60 and 4 of 60 degrees.
    np.testing.assert_allclose(
        [float(rows[name][1].split()[0]) for name in ("inlet", "ambient")],
        [100 * 2 / 60, 100 * 4 / 60],
        rtol=1e-3,
    )


def test_a_temperature_changes_by_degrees(celsius):
    table = tables(celsius)["wall: change per standard deviation of an input [degC]"]
    found = {name: float(cells[0].split()[0]) for name, cells in table.rows}
    assert found == {"flow": 0.05, "inlet": 0.5, "ambient": 3}
    reported = celsius["statistics/steps/wall/change_per_std"]
    assert reported.attrs["units"] == "K"
    np.testing.assert_allclose(reported.values[:, 0], [0.05, 0.5, 3], rtol=1e-9)


def test_json_says_what_a_relative_change_is_of(celsius):
    outputs = archive_json(celsius)["designs"]["steps"]["outputs"]
    duty, wall = (outputs[name]["sensitivity"] for name in ("duty", "wall"))
    assert "relative to the input in K, not in degC" in duty["inlet"]["response"]["note"]
    assert "not in degC" not in duty["flow"]["response"]["note"]
    assert "relative to the output in K, not in degC" in wall["flow"]["contribution"]["note"]
    assert wall["ambient"]["change_per_std"]["estimate"] == pytest.approx(3)


def test_the_page_and_the_figure_leave_them_out_and_say_so(celsius):
    response, times_uncertainty, change = charts(celsius)
    assert response.y.rows == ("flow",)
    assert f"Not shown: inlet, ambient ({REASON})." in response.notes
    # The input with the largest estimate stands first.
    assert times_uncertainty.y.rows == ("flow", "ambient", "inlet")
    assert change.y.rows == ("ambient", "inlet", "flow")
    assert change.x.title == "|change| per standard deviation [°C]"
    drawn = panels(celsius, "responses")
    assert [panel.title for panel in drawn] == [
        "duty: Response, near the nominal point",
        "duty: Response × uncertainty, near the nominal point",
        "wall: Change per standard deviation of an input, near the nominal point",
    ]
    assert [panel.rows for panel in drawn] == [each.y.rows for each in charts(celsius)]


def test_a_temperature_in_kelvin_has_per_cent(tmp_path):
    tree = study(tmp_path, "K", 363.15, 303.15)
    assert "change_per_std" not in tree["statistics/steps/wall"]
    rows = dict(tables(tree)["duty: responses to its inputs"].rows)
    assert float(rows["inlet"][0].split()[0]) == pytest.approx(100 * 363.15 / 60, rel=1e-3)


def test_an_earlier_archive_has_the_reason(celsius):
    tree = celsius.copy(deep=True)
    del tree["statistics/steps/wall"]["change_per_std"]
    table = tables(tree)["wall: responses to its inputs"]
    assert {cell for _, cells in table.rows for cell in cells} == {"– ¹"}
    assert table.notes == [REASON]


def test_a_change_keeps_its_sign_where_the_nominal_value_is_negative(tmp_path):
    tree = study(tmp_path, "degC", 90, 30, flow=-5)
    changes = tree["statistics/steps/wall/change_per_std"].values[:, 0]
    np.testing.assert_allclose(changes, [0.05, 0.5, 3], rtol=1e-9)
