"""The reason of a failed run names the line of the user's own code."""

import textwrap

import pytest
from study_text import study_text

import uqpen
from uqpen.execution.processes import processes

BEAM = """\
import helper
def simulate(x):
    return {"y": helper.root(x)}
"""
HELPER = """\
import math

def root(x):
    return math.sqrt(-1 - x)
"""
STUDY = study_text(
    {"python": "beam.py:simulate", "inputs": {"x": "1"}, "outputs": {"y": "m"}},
    seed=3,
    inputs={"x": (0, 1)},
    designs={"some": {"kind": "monte-carlo", "runs": 5}},
)
ROOT = "ValueError: math domain error (helper.py, line 4: return math.sqrt(-1 - x))"


def reasons(folder, beam, text=STUDY, **options):
    folder.mkdir(exist_ok=True)
    (folder / "beam.py").write_text(beam)
    (folder / "helper.py").write_text(HELPER)
    tree = uqpen.run(uqpen.parse_study(text, folder=folder), **options)
    return set(tree["runs/some"]["lost_reason"].values.tolist())


def test_it_is_the_innermost_line_of_the_users_files(tmp_path):
    # The innermost line of all is in a library.
    beam = "import numpy as np\ndef simulate(x):\n    return np.linalg.inv(np.zeros((1, 1)))\n"
    assert reasons(tmp_path / "a", BEAM) == {ROOT}
    expected = (
        "LinAlgError: Singular matrix (beam.py, line 3: return np.linalg.inv(np.zeros((1, 1))))"
    )
    assert reasons(tmp_path / "b", beam) == {expected}


@pytest.mark.slow
def test_it_is_the_same_in_every_folder_and_process(tmp_path):
    with processes(2) as pool:
        assert reasons(tmp_path / "other", BEAM, map=pool) == {ROOT}
    vectorized = STUDY.replace("[inputs]", "vectorized = true\n[inputs]")
    beam = BEAM.replace("root(x)", "root(max(x))")
    assert reasons(tmp_path / "third", beam, vectorized) == {ROOT}


def test_a_file_outside_the_study_has_its_name_only(tmp_path):
    text = STUDY.replace("beam.py", "../models/beam.py")
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "beam.py").write_text("def simulate(x):\n    return 1 / 0\n")
    (tmp_path / "study").mkdir()
    expected = {"ZeroDivisionError: division by zero (beam.py, line 2: return 1 / 0)"}
    assert reasons(tmp_path / "study", "", text) == expected


def test_an_exception_that_is_raised_again_has_the_line_of_this_time(tmp_path):
    beam = """\
        error = ValueError("no")
        def simulate(x):
            if x < 0.5:
                raise error
            raise error  # large
        """
    assert reasons(tmp_path, textwrap.dedent(beam)) == {
        "ValueError: no (beam.py, line 4: raise error)",
        "ValueError: no (beam.py, line 5: raise error # large)",
    }


def test_lines_are_counted_as_python_counts_them(tmp_path):
    beam = "\f\nTEXT = 'a\u2028b'\ndef simulate(x):\n    return 1 / 0  # now\n    # then\n"
    expected = {"ZeroDivisionError: division by zero (beam.py, line 4: return 1 / 0 # now)"}
    assert reasons(tmp_path, beam) == expected


def test_of_a_recursion_it_is_the_innermost_line(tmp_path):
    beam = """\
        def deeper(x, depth):
            return 1 / depth if depth == 0 else deeper(x, depth - 1)
        def simulate(x):
            return deeper(x, 50)
        """
    [reason] = reasons(tmp_path, textwrap.dedent(beam))
    assert "(beam.py, line 2: return 1 / depth if" in reason


def test_a_line_is_cut_and_an_edit_has_no_effect(tmp_path):
    beam = f"""\
        from pathlib import Path
        def simulate(x):
            Path(__file__).write_text("")
            raise ValueError("{"long " * 60}")
        """
    [reason] = reasons(tmp_path, textwrap.dedent(beam))
    assert reason.startswith("ValueError: long long")
    assert ' (beam.py, line 4: raise ValueError("long long' in reason
    assert reason.endswith("…)")
    assert len(reason) < 320


def _function(scale):
    def model(x):
        factor = scale / (x - x)
        return {"y": factor}

    return model


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_the_lines_of_a_function_of_a_program_count_from_its_own(workers):
    study = uqpen.Study(
        _function(2.0),
        inputs={"x": uqpen.Uniform(0, 1)},
        outputs={"y": "1"},
        designs={"some": uqpen.MonteCarlo(runs=3)},
        seed=1,
    )
    lost = uqpen.run(study, workers=workers)["runs/some"]["lost_reason"].values
    expected = "ZeroDivisionError: float division by zero (model, line 2: factor = scale / (x - x))"
    assert set(lost.tolist()) == {expected}
