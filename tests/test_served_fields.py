"""Fields over UM-Bridge: offered by uqpen as vectors, and read from vectors of a server."""

import numpy as np
import pytest
from model_servers import offering

import uqpen
from uqpen.cli.serve import make_offers
from uqpen.core.errors import StudyError
from uqpen.core.model import Dimension, Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.execution import Evaluator
from uqpen.execution.processes import processes
from uqpen.server import ServedModel

pytestmark = pytest.mark.slow

TIME = Dimension("time", "s", values=(0.0, 1.0, 2.0))
PLACE = Dimension("place", "m", values=(0.0, 1.0))


class Fields(Model):
    """A curve that ends early for a large x, two numbers, and a sheet."""

    name = "fields"
    inputs = (Input("x", "m"),)
    outputs = (
        Output("curve", "m", dims=(TIME,), may_end=True),
        Output("a", "m"),
        Output("b", "1"),
        Output("sheet", "m", dims=(TIME, PLACE)),
    )

    def evaluate(self, inputs):
        x = inputs["x"]
        curve = x[:, np.newaxis] + np.arange(3)
        curve[x > 1.5, 2] = np.nan
        sheet = np.arange(6.0).reshape(3, 2) * x[:, np.newaxis, np.newaxis]
        return Results.all_ok({"curve": curve, "a": 2 * x, "b": x * 0 + 7, "sheet": sheet})


STUDY = """\
seed = 1
[model]
inputs = {{ x = "m" }}
umbridge = "{address}"
[model.dimensions]
time = {{ unit = "s", values = [0, 1, 2] }}
place = {{ unit = "m", values = [0, 1] }}
[model.outputs]
{outputs}
[inputs]
x = {{ uniform = {{ lower = "1 m", upper = "2 m" }} }}
[designs.few]
kind = "monte-carlo"
runs = 10
"""
CURVE = 'curve = { unit = "m", along = ["time"], may_end = true }\n'
NUMBERS = 'a = "m"\nb = "1"\n'
SHEET = 'sheet = { unit = "cm", along = ["time", "place"] }'


@pytest.fixture(scope="module")
def address():
    with offering(ServedModel("fields", Evaluator(Fields()), ("x",))) as address:
        yield address


def study(address, outputs):
    text = STUDY.format(address=address, outputs=outputs)
    return uqpen.parse_study(text)  # type: ignore[return-value]


def problems(address, outputs):
    with pytest.raises(StudyError) as refused:
        study(address, outputs)
    return [str(problem) for problem in refused.value.problems]


def test_a_field_is_a_vector_and_numbers_share_one():
    offer = ServedModel("fields", Evaluator(Fields()), ("x",))
    assert offer.output_sizes == [3, 2, 6]
    assert offer.run([2.0]) == [[2.0, 3.0, None], [4.0, 7.0], [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]]


def test_the_built_in_trajectory_is_offered():
    (offer,) = make_offers("walker-anderson-trajectory")
    fields = [output for output in offer.outputs if output.dims]
    assert offer.output_sizes[: len(fields)] == [output.shape[0] for output in fields]


def test_what_is_served_is_read_back(address):
    runs = uqpen.run(study(address, CURVE + NUMBERS + SHEET))["runs/few"].to_dataset()
    assert not runs["status"].values.any()
    own = Fields().evaluate({"x": runs["x"].values}).outputs
    assert 0 < np.isnan(own["curve"]).sum() < 10
    for name, values in own.items():
        wanted = 0.01 * values if name == "sheet" else values
        np.testing.assert_allclose(runs[name].values, wanted, rtol=1e-14)
    assert runs["sheet"].dims == ("run", "time", "place")


def test_a_curve_that_ends_must_be_declared_so(address):
    runs = uqpen.run(study(address, CURVE.replace(", may_end = true", "") + NUMBERS + SHEET))
    few = runs["runs/few"]
    is_long = few["x"].values > 1.5
    expected = np.where(is_long, Status.NOT_FINITE, Status.OK)
    assert few["status"].values.tolist() == expected.tolist()
    assert {*few["lost_reason"].values} == {"curve is nan at time = 2 s"}


def test_workers_give_the_same_bytes(address):
    served = study(address, CURVE + NUMBERS + SHEET)
    with processes(2) as pool:
        together = uqpen.run(served, map=pool)
    assert uqpen.run(served).identical(together)


def test_sizes_are_checked_when_the_study_is_read(address):
    assert problems(address, CURVE + NUMBERS) == [
        'model.outputs: found 3 outputs of 5 numbers; expected as many as "fields" gives numbers: '
        "11 (3 + 2 + 6)"
    ]


def test_a_field_across_vectors_is_another_order(address):
    assert problems(address, NUMBERS + CURVE + SHEET) == [
        "model.outputs.curve: found 3 values from number 2 of what the server gives; expected all "
        'of them in one vector; "fields" gives 3 + 2 + 6 numbers'
    ]


def test_a_server_has_no_grid_of_its_own(address):
    own = CURVE.replace("may_end = true", 'on = { time = "t" }')
    assert problems(address, own + NUMBERS + SHEET) == [
        "model.outputs.curve.on: found coordinates of the run's own; expected none: a server's "
        "vectors have one length for all runs"
    ]


def test_coordinates_of_a_file_belong_to_the_study(address, tmp_path):
    (tmp_path / "times.csv").write_text("time [s]\n0\n1\n2\n")
    text = STUDY.replace('unit = "s", values = [0, 1, 2]', 'file = "times.csv"')
    text = text.format(address=address, outputs=CURVE + NUMBERS + SHEET)
    served = uqpen.parse_study(text, folder=tmp_path)
    assert [file.path.name for file in served.files()] == ["times.csv"]
