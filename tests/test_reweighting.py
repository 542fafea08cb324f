"""Studies with other distributions of their inputs, answered by the runs of an archive."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy import special

import uqpen
from uqpen.archive.read import open_archive
from uqpen.archive.structure import find_faults
from uqpen.checkpoints.make_archive import make_archive
from uqpen.core.errors import ArchiveError, StudyError
from uqpen.core.labels import REWEIGHTED_FROM
from uqpen.results.json import archive_json
from uqpen.verification.check_result import CheckOutcome

DESIGN = "monte_carlo"
OUTPUT = "statistics/monte_carlo/total"
MODEL = """
def total(x, y, bolt, load):
    if x < -3.2:
        raise ValueError("too small")
    return {"total": x + y + {"M8": 0.0, "M10": 1.0, "M12": 2.0}[bolt] + load}
"""
STUDY = """\
title = "Sums"
seed = 3
sensitivity = false
convergence = false
[model]
python = "sums.py:total"
[model.labels]
bolt = ["M8", "M10", "M12"]
[model.inputs]
x = "1"
y = "1"
load = "1"
[model.outputs]
total = "1"
[inputs]
x = { normal = { mean = 0, std = 1 } }
y = { uniform = { lower = 0, upper = 1 } }
bolt = { choice = { labels = ["M8", "M10"] } }
load = 2.0
[outputs.total]
exceeds = [3.0, 4.0, 8.0]
quantiles = [0.9]
[designs.monte_carlo]
kind = "monte-carlo"
runs = 3000
"""
# Other distributions, within those of the runs.
NEW = (
    STUDY.replace("mean = 0,", "mean = 0.4,")
    .replace("lower = 0, upper = 1", "lower = 0.25, upper = 1")
    .replace('["M8", "M10"] } }', '["M10", "M8"], weights = [3, 1] } }')
)
FAR = STUDY.replace("mean = 0,", "mean = 0.9,")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the model, and the archive of its study."""
    place = tmp_path_factory.mktemp("reweighted")
    (place / "sums.py").write_text(MODEL)
    for name, text in {"old": STUDY, "new": NEW, "far": FAR}.items():
        (place / f"{name}.toml").write_text(text)
    make_archive(uqpen.load_study(place / "old.toml"), place / "old.nc")
    uqpen.reweight(place / "old.nc", place / "new.toml", place / "new.nc")
    return place


def notes(archive: uqpen.Archive, statistic: str) -> list[str]:
    """Return the notes of a statistic."""
    frame = archive.to_frame()
    return frame[frame["statistic"] == statistic]["note"].tolist()


def exact(threshold: float) -> float:
    """P(total > threshold) of the new study, by the trapezoidal rule over y."""
    y = np.linspace(0.25, 1, 2001)
    found = sum(
        share * special.ndtr(0.4 + y + code + 2 - threshold) for share, code in ((3, 1), (1, 0))
    )
    return float(np.trapezoid(found, y) / 3)


def test_statistics_are_those_of_the_new_inputs(folder):
    new = uqpen.open_archive(folder / "new.nc")
    found = new[OUTPUT]
    for position, threshold in enumerate((3.0, 4.0)):
        estimate = found["exceedance"].isel(threshold=position)
        assert estimate.values[1] < exact(threshold) < estimate.values[2]
    assert all("effective runs with the event" in each for each in notes(new, "exceedance")[:2])
    mean = found["mean"].values
    assert mean[1] < 0.4 + 0.625 + 0.75 + 2 < mean[2]
    runs = new["runs/monte_carlo"]
    old = open_archive(folder / "old.nc")["runs/monte_carlo"]
    for name in ("x", "y", "bolt", "total", "status"):
        assert np.array_equal(runs[name].values, old[name].values, equal_nan=True)
    # 0.75 of a uniform, weights 3 : 1 of two equal labels, a shift by 0.4 standard deviations.
    share = 0.75 / 1.25 * np.exp(-0.16)
    assert f"{100 * share:.3g} % are expected" in runs.attrs["reweighted"]


def test_it_names_the_archive_of_its_runs_and_verifies(folder):
    old, new = (open_archive(folder / f"{name}.nc") for name in ("old", "new"))
    assert new.attrs[REWEIGHTED_FROM] == old.attrs["content_sha256"]
    results = {each.name: each for each in uqpen.verify(folder / "new.nc", trust=True, runs=20)}
    assert {"hashes", "runs", "weights", "statistics"} <= results.keys()
    assert {each.verdict for each in results.values()} == {CheckOutcome.EQUAL}


def test_changed_weights_are_found(folder, tmp_path):
    new = open_archive(folder / "new.nc")
    runs = new["runs/monte_carlo"].to_dataset()
    weights = runs["weight"].values.copy()
    weights[weights.argmax()] *= 1.01
    new["runs/monte_carlo"] = xr.DataTree(runs.assign_coords(weight=("run", weights)))
    uqpen.write(new, tmp_path / "changed.nc")
    results = {each.name: each.verdict for each in uqpen.verify(tmp_path / "changed.nc", runs=1)}
    assert results["weights"] is CheckOutcome.DIFFERENT


@pytest.mark.parametrize(
    "spoilt",
    [
        ("run", np.append(np.ones(2999), -1.0)),
        ("run", np.append(np.ones(2999), np.inf)),
        ("run", np.zeros(3000)),  # a weight of 0 is one, if some run counts
        ("run", np.full(3000, "1")),
        ("place", np.ones(3)),
    ],
)
def test_weights_that_are_none_are_a_fault(folder, spoilt):
    new = open_archive(folder / "new.nc")
    runs = new["runs/monte_carlo"].to_dataset()
    for weights in (spoilt, ("run", np.append(np.ones(2999), 0.0))):
        new["runs/monte_carlo"] = xr.DataTree(runs.assign_coords(weight=weights))
        said = "/runs/monte_carlo: a weight that is none"
        assert list(find_faults(new)) == [said] * (weights is spoilt)


def test_a_fresh_study_does_not_take_weighted_runs_for_its_own(folder, tmp_path):
    """It has other points, so its archive is not the one that is there."""
    path = tmp_path / "new.nc"
    path.write_bytes((folder / "new.nc").read_bytes())
    text = NEW.replace("runs = 3000", "runs = 30")
    (folder / "few.toml").write_text(text)
    made = make_archive(uqpen.load_study(folder / "few.toml"), path)
    assert "weight" not in made["runs/monte_carlo"].coords
    assert REWEIGHTED_FROM not in made.attrs


def test_few_effective_runs_leave_no_interval(folder):
    found = uqpen.reweight(folder / "old.nc", folder / "far.toml")
    tail = found[OUTPUT]["exceedance"].isel(threshold=2)
    assert np.isnan(tail.values[1:]).all()
    # 0.444 of the runs: a mean is approximate.
    assert "approximate: the weights leave 4" in notes(found, "mean")[0]
    further = folder / "further.toml"
    further.write_text(STUDY.replace("mean = 0,", "mean = 1.3,"))
    lost = uqpen.reweight(folder / "old.nc", further)
    for name in ("mean", "std", "exceedance", "quantile"):
        values = lost[OUTPUT][name].values.reshape(-1, 3)
        assert np.isnan(values[:, 1:]).all()
    assert "an interval needs 30 %" in notes(lost, "mean")[0]


def test_page_tables_and_json_say_that_runs_are_weighted(folder, tmp_path):
    new = uqpen.open_archive(folder / "new.nc")
    found = archive_json(new)
    design = found["designs"]["monte_carlo"]
    assert design["reweighted"].startswith("runs drawn for other distributions of the inputs")
    assert json.dumps(found)
    assert "weight" in new.runs_to_frame().columns
    assert "Weights" in new.summary() or "runs drawn for other" in new.summary().lower()
    uqpen.write_report(new, tmp_path / "new.html")
    page = (tmp_path / "new.html").read_text(encoding="utf-8")
    assert "runs drawn for other distributions of the inputs" in page.lower()


@pytest.mark.parametrize(
    ("before", "after", "key", "found"),
    [
        ("load = 2.0", "load = 2.5", "inputs.load", "2.5"),
        ("load = 2.0", 'load = "y + 2"', "inputs.load", '"y + 2"'),
        ("x = { normal = { mean = 0, std = 1 } }", "x = 1", "inputs.x", "1.0"),
        ("mean = 0, std = 1 ", "mean = 0, std = 1.42 ", "inputs.x", "the weights of x have no f"),
        ("lower = 0, upper = 1 ", "lower = 0, upper = 2 ", "inputs.y", "no run has y near 1"),
        ('["M8", "M10"] } }', '["M8", "M12"] } }', "inputs.bolt", "no run has bolt near 2"),
        ("runs = 3000", "runs = 300", "designs.monte_carlo", "other settings"),
        ("seed = 3", "seed = 4", "seed", "4"),
        ('"sums.py:total"', '"other.py:total"', "model", "model.python was "),
        ("[outputs.total]", '[constraints]\nkeep = ["x > -9"]\n[outputs.total]', "constraints",
         "other constraints"),
        ("[designs.monte_carlo]",
         '[designs.more]\nkind = "monte-carlo"\nruns = 10\n[designs.monte_carlo]', "designs.more",
         "a design without runs in the archive"),
        ("[designs.monte_carlo]",
         f'[surrogates.gp]\nkind = "gaussian-process"\ndesign = "{DESIGN}"\n[designs.{DESIGN}]',
         "surrogates", "a surrogate, which would be fitted to weighted runs"),
    ],
)  # fmt: skip
def test_a_study_that_changes_more_is_refused_with_its_line(folder, before, after, key, found):
    (folder / "other.py").write_text(MODEL.replace("+ load", "+ 2 * load"))
    study, text = folder / "changed.toml", STUDY.replace(before, after)
    study.write_text(text)
    with pytest.raises(StudyError) as caught:
        uqpen.reweight(folder / "old.nc", study)
    message = str(caught.value)
    assert f"  {key}\n    found     {found}" in message
    # A table has the line of its head, a key that of its own.
    line = int(message.partition(f"  {key}\n")[0].rpartition(":")[2])
    head = text.split("\n")[line - 1]
    assert head.startswith((key.rpartition(".")[2], f"[{key}"))


def test_archives_without_independent_draws_are_refused(folder, tmp_path):
    text = STUDY.replace(
        'kind = "monte-carlo"\nruns = 3000',
        'kind = "latin-hypercube"\nruns = 40\nreplicates = 4',
    )
    (folder / "strata.toml").write_text(text)
    make_archive(uqpen.load_study(folder / "strata.toml"), folder / "strata.nc")
    with pytest.raises(ArchiveError, match="weights spoil its strata"):
        uqpen.reweight(folder / "strata.nc", folder / "strata.toml")
    with pytest.raises(ArchiveError, match="have weights already"):
        uqpen.reweight(folder / "new.nc", folder / "new.toml")
    (tmp_path / "half.nc.parts").mkdir()
    with pytest.raises(ArchiveError, match=r"half.nc: is not finished"):
        uqpen.reweight(tmp_path / "half.nc", folder / "new.toml")
    with pytest.raises(ArchiveError, match="has the runs themselves"):
        uqpen.reweight(folder / "old.nc", folder / "new.toml", folder / "old.nc")


def test_the_command_writes_beside_the_archive(folder, command_line):
    done = command_line("reweight", str(folder / "old.nc"), str(folder / "new.toml"), "-q")
    assert done.code == 0
    assert "P(> 3.0): 7" in done.out
    assert "new_reweighted.nc" in done.out
    assert (Path(folder) / "new_reweighted.nc").is_file()
