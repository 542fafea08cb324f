"""What the README prints works as printed."""

import re
from pathlib import Path

import pytest

import uqpen
from uqpen.results.output_tables import output_tables

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_example_of_a_beam_runs_and_is_right(tmp_path):
    model, study = blocks("python")[0], blocks("toml")[0]
    (tmp_path / "beam.py").write_text(model, encoding="utf-8")
    (tmp_path / "beam.toml").write_text(study, encoding="utf-8")
    loaded = uqpen.load_study(tmp_path / "beam.toml")
    table = next(output_tables(uqpen.run(loaded)))
    assert table.title == "deflection [mm]"
    mean = float(dict(table.rows)["mean"][0].split()[0])
    # 10 kN · (3 m)³ / (48 · 210 GPa · 8e-6 m⁴) = 3.35 mm; the spread of the inputs adds 0.5 %.
    assert mean == pytest.approx(3.35, rel=0.02)


def test_continuous_integration_runs_what_is_printed():
    line = next(block for block in blocks("sh") if "pytest" in block).strip()
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    contributing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    install, _, tests = line.rpartition(" && ")
    assert script.index(install) < script.index(tests)
    assert line in contributing
    checks = re.findall(r"```sh\n(.*?)```", contributing, flags=re.DOTALL)[1].splitlines()
    assert len(checks) == 4
    assert all(
        script.index(install) < script.index(check) < script.index(tests) for check in checks
    )
