"""First studies that `uqpen init` writes: they are right as they are."""

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from uqpen.core.errors import ModelError
from uqpen.study.load import parse_study
from uqpen.study.new_study import data_draft, function_draft

BEAM = """
from typing import Annotated
raise SystemExit("a file that is parsed is not executed")

def deflection(load: Annotated[float, "kN"] = 5, modulus: "GPa" = 210, *,
               width, names=("a", "b"), steps: int = 3, verbose=False, offset=-0.0):
    \"\"\"Deflection of a cantilever.

    In mm.
    \"\"\"
    def inner():
        return {"inside": 1}
    if width < 0:
        return dict(tip=0.0, root=0.0)
    return {"tip": load / modulus, "root": offset}

def _private(x):
    return {"y": x}
"""


def _written(command_line, *arguments):
    done = command_line("init", *arguments, "-o", "study.toml")
    assert done.err == ""
    return tomllib.loads(Path("study.toml").read_text(encoding="utf-8"))


def test_a_function_gives_its_inputs_units_nominal_values_and_outputs(command_line, tmp_path):
    (tmp_path / "beam.py").write_text(BEAM)
    content = _written(command_line, "beam.py:deflection")
    assert content["title"] == "Deflection of a cantilever"
    assert content["model"]["python"] == "beam.py:deflection"
    assert content["model"]["inputs"] == {
        "load": "kN",
        "modulus": "GPa",
        "width": "1",
        "offset": "1",
    }
    assert content["model"]["outputs"] == {"tip": "1", "root": "1"}
    ends = {name: each["uniform"] for name, each in content["inputs"].items()}
    assert ends["load"] == {"lower": "4.5 kN", "upper": "5.5 kN"}
    assert ends["width"] == {"lower": 0.9, "upper": 1.1}
    assert ends["offset"] == {"lower": -0.1, "upper": 0.1}
    text = Path("study.toml").read_text(encoding="utf-8")
    assert "# names, steps, verbose: left at the default of the function" in text
    marked = [line for line in text.splitlines() if "# FILL IN" in line]
    assert len(marked) == 2 + 2 + 4  # units of inputs and outputs, distributions


# Within a range where 10 % of a temperature in degC is not lost beside 273.15 K.
SIZES = st.floats(1e-6, 1e12)
VALUES = st.none() | st.just(0) | SIZES | SIZES.map(lambda size: -size) | st.integers(1, 10**12)
SIGNATURES = st.dictionaries(
    st.from_regex(r"[a-z]{1,8}_[0-9]", fullmatch=True),
    st.tuples(VALUES, st.sampled_from(["", "kN", "degC", "float", "1"])),
    min_size=1,
    max_size=4,
)


@settings(max_examples=30)
@given(signature=SIGNATURES)
def test_a_study_of_any_signature_passes_as_it_is_written(signature, tmp_path_factory):
    folder = tmp_path_factory.mktemp("signature")
    arguments = ", ".join(
        name + f": {unit!r}" * bool(unit) + f" = {default!r}" * (default is not None)
        for name, (default, unit) in signature.items()
    )
    source = f"def f(*, {arguments}):\n    return {{'y': 1.0}}\n"
    (folder / "model.py").write_text(source)
    text = function_draft(folder / "model.py", "", "model.py").text("study.toml")
    study = parse_study(text, folder=folder)
    for name, (default, _) in signature.items():
        entry = next(each for each in study.joint.random if each.variable.name == name)
        assert entry.distribution.ppf(0.1) < entry.nominal < entry.distribution.ppf(0.9)
        if default and entry.display_unit == "1":
            assert entry.nominal == pytest.approx(float(default), rel=1e-5)


def test_a_program_gets_its_inputs_from_placeholders_in_their_order(command_line, tmp_path):
    (tmp_path / "beam.dat.template").write_text("FORCE {force}\nLENGTH {length:.10e} {{}}\n")
    (tmp_path / "solver").write_text("#!/bin/sh\necho result = 2.5\n")
    (tmp_path / "solver").chmod(0o755)
    command = "./solver --width {width} 'beam.dat'"
    content = _written(command_line, "beam.dat.template", "--command", command)
    assert content["model"]["command"] == ["./solver", "--width", "{width}", "beam.dat"]
    assert content["model"]["templates"] == {"beam.dat": "beam.dat.template"}
    assert list(content["model"]["inputs"]) == ["width", "force", "length"]
    checked = command_line("check", "study.toml").out
    assert "the study is right" in checked
    assert "warning: 8 lines are still marked FILL IN" in checked
    text = Path("study.toml").read_text(encoding="utf-8")
    Path("study.toml").write_text(text.replace("# FILL IN", "#"), encoding="utf-8")
    assert "FILL IN" not in command_line("check", "study.toml").out
    assert "2.5" in command_line("run", "study.toml").out
    Path("study.toml").unlink()
    content = _written(command_line, "--command", f"{command} {{outputs}}")
    assert "read" not in content["model"]  # a JSON file whose path the program is given


def test_a_data_file_gives_its_columns_and_claims_nothing_of_its_points(command_line, tmp_path):
    heading = "load [kN],span,2nd [m],peak [MPa],bend [mm],note,sag [spans],status,reason\n"
    rows = "4,2,1,,7,a,1,failed,diverged\n5,2,3,FAIL,8,b,1,,\n6,3,1,31,9,c,1,ok,\n"
    (tmp_path / "runs.csv").write_text(heading + rows)
    content = _written(command_line, "runs.csv")
    assert content["model"] == {
        "data": "runs.csv",
        "outputs": ["peak", "bend"],  # an input has no blank; the last column
        "ignore": ["note", "sag"],
        "columns": {"column_2nd": "2nd [m]"},
        "together": True,
    }
    assert content["surrogates"] == {"cheap": {"kind": "gaussian-process", "design": "data"}}
    text = Path("study.toml").read_text(encoding="utf-8")
    for comment in (
        'inputs = ["load", "span", "column_2nd"]',
        '"note" has texts',
        '"sag" has no unit that is known: "spans"',
        "The column status: what became of each run.",
        "independent = true",
        'load = { uniform = { lower = "4 kN", upper = "6 kN" } }',
    ):
        assert f"\n# {comment}\n" in text
    assert "the study is right" in command_line("check", "study.toml").out
    # What stands in comments is right, too.
    lines = ("[inputs]", "load = ", "span = ", "column_2nd = ", "independent = true")
    for line in (*lines, "[model.units]", "span = ", "[designs.data]", 'kind = "data"'):
        text = text.replace(f"# {line}", line)
    assert parse_study(text, folder=tmp_path).designs["data"].sampling.is_sample


def test_a_table_of_a_spreadsheet_gives_its_headings_and_outputs(command_line, tmp_path):
    rng = np.random.default_rng(1)
    rain, area, slope = rng.gamma(4, 10, 500), rng.uniform(1, 9, 500), rng.uniform(0.01, 0.1, 500)
    peak = rain * area * slope**0.5
    columns = {
        "Run": np.arange(500),
        "Rain (mm)": np.where(np.arange(500) == 7, -9999, rain),
        "Land use": np.where(np.arange(500) % 2, "wood", "town"),
        "Area [km2]": area,
        "Bed slope": slope,
        "Peak flow (m3/s)": peak,
        "T_peak [h]": area / slope**0.5,
        "flooded": (peak > 40).astype(int),
    }
    pd.DataFrame(columns).to_csv(tmp_path / "runs.csv", index=False)
    model = _written(command_line, "runs.csv")["model"]
    assert model["outputs"] == ["Peak_flow", "T_peak", "flooded"]
    assert model["columns"] == {
        "Land_use": "Land use",
        "Bed_slope": "Bed slope",
        "Peak_flow": "Peak flow (m3/s)",
    }
    assert (model["missing"], model["drop"]) == ([-9999], "blank inputs")
    assert model["ignore"] == ["Run"]
    assert '\n# "Run" numbers the runs\n' in Path("study.toml").read_text(encoding="utf-8")
    assert "the study is right" in command_line("check", "study.toml").out


@pytest.mark.parametrize("name", ["dakota.dat", "easyvvuq.csv", "openturns.csv"])
def test_a_file_of_another_program_gives_a_study_that_passes(command_line, name):
    content = _written(command_line, str(Path(__file__).parents[1] / "data" / "runs" / name))
    assert len(content["model"]["outputs"]) == 1
    assert "the study is right" in command_line("check", "study.toml").out


CELLS = st.lists(st.sampled_from(["1", "2.5", "-1e3", "", "inf", "text"]), min_size=2, max_size=2)
HEADINGS = st.sampled_from(
    ["y [mm]", "z [1]", "w [spans]", "weight [kg]", "replicate", "reason", "run", "1st", "é"]
)


@settings(max_examples=50)
@given(columns=st.dictionaries(HEADINGS, CELLS, max_size=5))
def test_a_study_of_any_data_file_passes_as_it_is_written(columns, tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    table = pd.DataFrame({"a": [1, 2], **columns, "b": [3, 4]})
    table.to_csv(folder / "a.csv", index=False, encoding="utf-8")
    try:
        draft = data_draft(folder / "a.csv", "a.csv")
    except ModelError as error:
        # No study takes such a replicate or weight, and the message says where it stands.
        assume('column "weight"' not in str(error) and 'column "replicate"' not in str(error))
        raise
    study = parse_study(draft.text("study.toml"), folder=folder)
    assert "a" in [each.name for each in study.model.inputs]
    assert "b" in [each.name for each in study.model.outputs]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["beam.py:bend"], 'beam.py has no function "bend"; known: deflection'),
        (["two.py"], "expected the name of a function; two.py:f, two.py:g"),
        (["two.py:f"], "f has no argument that is a number"),
        (["two.py:g"], "g takes x by position; expected arguments that can be given by name"),
        (["two.py:h_"], 'two.py has no function "h_"'),
        (["none.py:f"], "none.py: cannot be read: No such file or directory"),
        (["broken.py:f"], "broken.py, line 2: is no Python: "),
        (["there.py:f", "-o", "beam.py"], "beam.py: is there already; expected a new file (-o)"),
        (["a.json"], "found a.json; expected FILE.py:FUNCTION, a data file (.csv, "),
        (["none.csv"], 'none.csv: found no file "none.csv"; expected a CSV, Excel, NetCDF,'),
        (["texts.csv"], '"x" has texts; expected one without a blank for an input, and one for'),
        (["state.csv"], 'found "fine" in column "status", state.csv, line 2; expected one of ok'),
        (["--command", "./solver 1"], "the command does not have a placeholder such as {load}"),
        (["--command", "./solver {x-1}"], 'the placeholder "x-1" cannot be named in a study'),
        (["--command", "./solver '{x}"], "--command: found ./solver '{x}: No closing quotation"),
        (["no.tmpl", "--command", "s {x}"], "no.tmpl: cannot be read: No such file"),
    ],
)
def test_mistakes(command_line, tmp_path, arguments, message):
    (tmp_path / "beam.py").write_text(BEAM)
    (tmp_path / "two.py").write_text("def f(x=None): ...\ndef g(x, /): ...\n")
    (tmp_path / "broken.py").write_text("x = 1\ndef f(\n")
    (tmp_path / "texts.csv").write_text("x,y\none,1\n")
    (tmp_path / "state.csv").write_text("x,y,status\n1,2,fine\n")
    done = command_line("init", *arguments)
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert not list(tmp_path.glob("*.toml"))
