"""The benchmark beside other packages: its table, and what it says of one that is missing."""

import sys
from pathlib import Path

import numpy as np
import pytest

from uqpen.models.known_functions import Ishigami

peers = pytest.importorskip("peers", reason="the folder of benchmarks is not here")


def rows(seconds):
    figures = {"mean": peers.shared.MEAN}
    return {
        "uqpen": (100, [peers.Measured(1.0, figures)] * 3),
        "other": (100, [peers.Measured(seconds, figures)] * 3),
    }


def test_each_requirement_has_a_script():
    lines = (peers.HERE / "peers.txt").read_text(encoding="utf-8").splitlines()
    names = [line.partition("==")[0].lower() for line in lines if not line.startswith("#")]
    assert names
    for name in names:
        assert (peers.HERE / "peers" / f"with_{name}.py").is_file()


def test_a_package_that_is_not_there_is_named_as_missing(tmp_path):
    found = peers._package("no-such-package", Path(sys.executable))
    assert found.startswith("cannot be imported: ")
    assert "Missing: no-such-package (cannot be imported" in peers._machine(
        {"no-such-package": found}, 3
    )


def test_the_model_is_that_of_uqpen_and_its_indices_are_exact():
    points = peers.shared.fresh_points()
    inputs = dict(zip(peers.shared.NAMES, points.T, strict=True))
    expected = Ishigami().evaluate(inputs).outputs["y"]
    np.testing.assert_allclose(peers.shared.function(points), expected, rtol=1e-13)
    np.testing.assert_allclose(
        [peers.shared.one_run(*point) for point in points[:10]], expected[:10], rtol=1e-13
    )
    # Published: 0.3139, 0.4424, 0 and 0.5576, 0.4424, 0.2437.
    np.testing.assert_allclose(peers.shared.FIRST_ORDER, (0.3139, 0.4424, 0.0), atol=1e-4)
    np.testing.assert_allclose(peers.shared.TOTAL_ORDER, (0.5576, 0.4424, 0.2437), atol=1e-4)


@pytest.mark.parametrize(("seconds", "ahead"), [(0.5, True), (2.0, False)])
def test_a_row_in_which_uqpen_is_behind_is_known(seconds, ahead):
    found = rows(seconds)
    assert peers._is_ahead_of_us(found["other"], found) is ahead


def test_ratios_are_to_the_process_of_the_same_turn():
    work = peers.Work("work", "start", 100, "")
    *_, other = peers._rows(work, rows(2.0), {})
    assert "| other | 2.00 | 2 (2 to 2) |" in other
