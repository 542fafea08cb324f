"""Archives of studies of several blocks: with any workers, interrupted in a block or at its end."""

from itertools import islice

import numpy as np
import pytest
from interrupted_study import Interrupted
from study_text import study_text

import uqpen
from uqpen.checkpoints.stored_runs import FinishedRuns, read_runs, write_runs
from uqpen.core.errors import CheckpointError
from uqpen.execution.processes import processes

pytestmark = [pytest.mark.processor, pytest.mark.slow]

# Batches have 1 024 runs: they begin at 0, 1 024, 2 048, 3 072 and 4 096.
MODEL = """\
import numpy as np
def simulate(x, y):
    return {"z": np.where(x > 2.2, np.nan, x * y)}
"""
STUDY = study_text(
    {
        "python": "model.py:simulate",
        "vectorized": True,
        "inputs": {"x": "1", "y": "m"},
        "outputs": {"z": "m"},
    },
    title="Blocks",
    seed=11,
    inputs={"x": "0 ± 1", "y": "(0 ± 1) m"},
    designs={"one": {"kind": "monte-carlo", "runs": 4_500}},
)


@pytest.fixture
def blocks_of(monkeypatch):
    """Makes blocks small, where they are no matter of random streams; runs are kept at once."""

    def shrink(size):
        for module in (
            "core.blocks",
            "execution.open_blocks",
            "designs.rounds",
            "checkpoints.folder",
        ):
            monkeypatch.setattr(f"uqpen.{module}.BLOCK", size)

    monkeypatch.setattr("uqpen.checkpoints.folder._PATIENCE", 0.0)
    return shrink


@pytest.fixture
def folder(tmp_path):
    return written(tmp_path)


def written(folder):
    (folder / "model.py").write_text(MODEL)
    (folder / "study.toml").write_text(STUDY)
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The archive of the study where one block holds all runs."""
    return make(written(tmp_path_factory.mktemp("whole")))


def make(folder, **options):
    uqpen.make_archive(uqpen.load_study(folder / "study.toml"), folder / "study.nc", **options)
    return (folder / "study.nc").read_bytes()


def parts(folder):
    return [read_runs(file) for file in sorted(folder.glob("study.nc.parts/runs/one/*.npz"))]


def backwards(work, batches):
    coming = iter(batches)
    while some := list(islice(coming, 3)):
        yield from (work(batch) for batch in reversed(some))


@pytest.mark.parametrize(("workers", "size"), [(1, 1_500), (2, 1_500), (3, 2_048)])
def test_any_workers_write_the_same_bytes(folder, whole, blocks_of, workers, size):
    blocks_of(size)
    with processes(workers) as pool:
        assert make(folder, map=pool) == whole


@pytest.mark.parametrize(
    ("batches", "size", "map"),
    [(1, 1_500, map), (2, 2_048, map), (4, 1_500, backwards)],
    ids=["within a block", "at the end of a block", "out of order"],
)
def test_an_interruption_changes_no_byte(folder, whole, blocks_of, batches, size, map):
    blocks_of(size)
    stopped = Interrupted(batches)
    with pytest.raises(KeyboardInterrupt) as interrupted:
        make(folder, map=map, progress=stopped)
    assert str(interrupted.value).startswith(f"{stopped.made} runs are kept")
    for part in parts(folder):
        assert part.runs[0] // size == part.runs[-1] // size, "a file has runs of one block"
    reported = Interrupted()
    assert make(folder, progress=reported) == whole
    assert reported.restored == stopped.made == 4_500 - reported.made


def test_runs_that_were_kept_without_blocks_are_restored(folder, whole, blocks_of):
    with pytest.raises(KeyboardInterrupt):
        make(folder, progress=Interrupted(4))
    blocks_of(1_500)
    (part,) = parts(folder)
    assert (part.runs[0], part.runs[-1]) == (0, 4_095)
    reported = Interrupted()
    assert make(folder, progress=reported) == whole
    assert reported.restored == 4_096


def test_other_points_of_a_later_block_are_refused(folder, blocks_of):
    blocks_of(1_500)
    with pytest.raises(KeyboardInterrupt):
        make(folder, progress=Interrupted(4))
    last = sorted(folder.glob("study.nc.parts/runs/one/*.npz"))[-1]
    part = read_runs(last)
    assert part.runs[0] >= 3_000
    x = part.inputs["x"].copy()
    x[3] = np.nextafter(x[3], 1)
    write_runs(last, FinishedRuns(part.runs, {**part.inputs, "x": x}, part.results))
    with pytest.raises(CheckpointError, match="its points: has a file changed"):
        make(folder)
    write_runs(last, FinishedRuns(part.runs + 1_000, part.inputs, part.results))
    with pytest.raises(CheckpointError, match="its points: has a file changed"):
        make(folder)


def test_runs_in_memory_are_written_after_a_few_blocks(folder, whole, blocks_of, monkeypatch):
    blocks_of(1_500)
    monkeypatch.setattr("uqpen.checkpoints.folder._PATIENCE", 1e9)
    monkeypatch.setattr("uqpen.checkpoints.folder._MOST_UNWRITTEN", 3_000)
    seen = []

    class Watching(Interrupted):
        def advance(self, runs, failed, in_progress):
            seen.append(sum(len(part.runs) for part in parts(folder)))

    assert make(folder, progress=Watching()) == whole
    assert seen[0] <= 1_024
    assert seen[-1] >= 3_000
