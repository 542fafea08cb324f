"""Designs of more runs than are in memory: their runs go block by block through files."""

import gc
import json
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from interrupted_study import Interrupted
from study_text import study_text

import uqpen
from uqpen.archive.hashes import group_hashes
from uqpen.archive.lazy_variables import is_in_memory
from uqpen.archive.netcdf import read_groups, write_tree
from uqpen.checkpoints.folder import CheckpointFolder
from uqpen.checkpoints.make_archive import ResumeOptions, make_archive
from uqpen.checkpoints.stored_runs import read_runs
from uqpen.core.blocks import LoadedDataset
from uqpen.core.errors import CheckpointError
from uqpen.core.labels import FAILED_RUN
from uqpen.core.streams import Stream
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
from uqpen.execution import Progress
from uqpen.execution.processes import processes
from uqpen.results.export import table_content
from uqpen.results.long_table import run_table_parts, runs_table
from uqpen.study.identity import run_fingerprint
from uqpen.study.study import ONLY_MODEL
from uqpen.verification.diff import diff_runs
from uqpen.workflow import run_design

pytestmark = pytest.mark.processor

# Some runs fail, some have no value of a derived output.
MODEL = """\
import numpy as np
def simulate(x, y):
    return {"z": np.where(x > 2.2, np.nan, x * y)}
"""
STUDY = study_text(
    {
        "python": "model.py:simulate",
        "vectorized": True,
        "inputs": {"x": "1", "y": "m", "length": "m"},
        "outputs": {"z": "m"},
    },
    seed=11,
    sensitivity=False,
    convergence=False,
    inputs={"x": "0 ± 1", "y": "(0 ± 1) m", "length": "2 m"},
    designs={"one": {"kind": "monte-carlo", "runs": 4_500}},
)
BLOCK = 1_500
LIMIT = 2_000


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    """Make blocks small, where they are no matter of random streams."""
    execution = ("core.blocks", "execution.open_blocks", "designs.rounds", "checkpoints.folder")
    for module in ("archive.lazy_variables", *execution):
        monkeypatch.setattr(f"uqpen.{module}.BLOCK", BLOCK)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "model.py").write_text(MODEL.replace("(x, y)", "(x, y, length)"))
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def make(folder, limit=LIMIT, *, fresh=False):
    """Make the archive of the study, and return its bytes."""
    study = uqpen.load_study(folder / "study.toml")
    resume = ResumeOptions(fresh=fresh, reuse=None)
    make_archive(study, folder / "study.nc", resume, runs_in_memory=limit)
    return (folder / "study.nc").read_bytes()


def runs(folder, limit=LIMIT, progress=None, map=map, *, lost_again=False):
    """Make the runs of the design alone, with a checkpoint."""
    study = uqpen.load_study(folder / "study.toml")
    fingerprints = {(ONLY_MODEL, "one"): run_fingerprint(study, ONLY_MODEL, "one")}
    progress = progress or Progress()
    kept = CheckpointFolder(folder / "parts", fingerprints, progress, limit)
    kept.check_compatibility()
    if lost_again:
        kept.discard_failed()
    made = run_design(
        study,
        study.designs["one"],
        Stream(study.seed, "designs", "one"),
        map=map,
        progress=progress,
        round_checkpoint=partial(kept.checkpoint, "one"),
    )
    return made[ONLY_MODEL]


def test_runs_in_memory_are_on_the_disk_before_they_are_analysed(folder, monkeypatch):
    monkeypatch.setattr(CheckpointFolder, "save_if_due", lambda kept, unwritten: None)
    made = runs(folder, limit=10_000)
    kept = [read_runs(file) for file in (folder / "parts" / "runs" / "one").glob("*.npz")]
    assert sum(len(each.runs) for each in kept) == made.sizes["run"] == 4500


def assert_same(found, expected):
    assert list(found.variables) == list(expected.variables)
    for name, variable in expected.variables.items():
        assert found.variables[name].to_base_variable().identical(variable.to_base_variable())


def killed_after(folder, batches):
    """Stop after a number of batches, as a kill would; return the folder of what is kept."""
    with pytest.raises(KeyboardInterrupt):
        runs(folder, progress=Interrupted(batches))
    return folder / "parts" / "runs" / "one"


@pytest.fixture
def expected(folder):
    """The runs in memory."""
    (folder / "memory").mkdir()
    for name in ("model.py", "study.toml"):
        (folder / "memory" / name).write_bytes((folder / name).read_bytes())
    return runs(folder / "memory", limit=10**6)


def test_the_archive_has_the_same_bytes_as_from_memory(folder):
    by_blocks = make(folder)
    assert not (folder / "study.nc.parts").exists()
    assert make(folder, limit=10**6, fresh=True) == by_blocks


@pytest.mark.skipif(sys.platform != "linux", reason="open files are listed by Linux")
def test_runs_are_read_from_the_archive_as_their_own_files_are_removed(folder):
    """A removed file takes its room on the disk as long as it is open."""
    small = '[designs.few]\nkind = "monte-carlo"\nruns = 20\n'
    study = uqpen.parse_study(STUDY + small, folder=folder)
    made = make_archive(study, folder / "study.nc", ResumeOptions(reuse=None), runs_in_memory=LIMIT)
    gc.collect()
    own = [str(each.readlink()) for each in Path("/proc/self/fd").iterdir() if each.is_symlink()]
    assert {each for each in own if each.startswith(str(folder))} == {str(folder / "study.nc")}
    assert not is_in_memory(made["runs/one/z"].variable)


@pytest.mark.parametrize("workers", [1, 2])
def test_runs_are_those_in_memory(folder, expected, workers):
    with processes(workers) as pool:
        found = runs(folder, map=pool)
    assert not is_in_memory(found.variables["z"])
    assert_same(found, expected)


def test_a_kill_costs_one_block_at_the_most(folder, expected):
    kept = killed_after(folder, 4)  # 4 096 runs: two blocks, and a part of the last
    names = ["0_blocks.jsonl", "0_blocks.nc", "made_of.json"]
    assert sorted(file.name for file in kept.iterdir()) == names
    again = Interrupted()
    assert_same(runs(folder, progress=again), expected)
    assert again.restored == 2 * BLOCK


def test_a_block_that_was_being_written_is_made_again(folder, expected):
    kept = killed_after(folder, 4)
    with (kept / "0_blocks.jsonl").open("ab") as record:
        record.write(b'{"start": 3000, "ru')
    assert_same(runs(folder), expected)
    assert_same(runs(folder), expected)  # from the record, which is whole again


def test_a_damaged_block_is_found_and_made_again(folder, expected):
    kept = killed_after(folder, 4)
    first, second = (kept / "0_blocks.jsonl").read_text().splitlines()
    wrong = {**json.loads(second), "crc32": 0}
    (kept / "0_blocks.jsonl").write_text(f"{first}\n{json.dumps(wrong)}\n")
    again = Interrupted()
    assert_same(runs(folder, progress=again), expected)
    assert any(
        "0_blocks.nc: is damaged; its runs are made again" in each for each in again.warnings
    )


def test_failed_runs_of_blocks_are_made_again_where_asked(folder, expected):
    killed_after(folder, 4)
    again = Interrupted()
    assert_same(runs(folder, progress=again, lost_again=True), expected)
    assert 0 < again.restored < 2 * BLOCK


def test_blocks_of_a_changed_design_are_not_lost_without_a_word(folder):
    killed_after(folder, 4)
    (folder / "study.toml").write_text(STUDY.replace("4500", "5000"))
    with pytest.raises(CheckpointError, match="runs"):
        runs(folder)


def test_a_model_without_known_versions_keeps_runs_for_one_start_alone(
    folder, expected, monkeypatch
):
    monkeypatch.setattr(CheckpointFolder, "checkpoint", CheckpointFolder.scratch)
    killed_after(folder, 4)
    again = Interrupted()
    assert_same(runs(folder, progress=again), expected)
    assert (again.restored, again.made) == (0, 4_500)


ROUNDS = """\
until = { z = { mean = "1e-6 m" } }
at_most = 8_192
"""


@pytest.fixture
def rounds_folder(folder):
    """Rounds of 512, 512, 1 024, 2 048 and 4 096 runs: the last two go by blocks."""
    (folder / "study.toml").write_text(STUDY.replace("runs = 4500\n", ROUNDS))
    return folder


def test_later_rounds_go_by_blocks_and_are_those_in_memory(rounds_folder):
    found = runs(rounds_folder)
    assert not is_in_memory(found.variables["z"])
    assert len({*found["round"].values.tolist()}) == 5
    (rounds_folder / "parts").rename(rounds_folder / "other")
    whole = runs(rounds_folder, limit=10**6)
    assert whole.sizes[FAILED_RUN] > 5
    assert_same(found, whole)
    rng = np.random.default_rng(3)
    for part in (slice(900, 5_200), slice(None, None, -7), rng.permutation(8_192)[:300], 4_100):
        for name in ("run", "round", "x", "z", "status"):
            values = found.variables[name][part].values
            np.testing.assert_array_equal(values, whole.variables[name][part].values)
    block = LoadedDataset(found).read(2_000, 5_000)
    assert_same(block, LoadedDataset(whole).read(2_000, 5_000)[[*block.variables]])


def test_an_archive_of_rounds_by_blocks_has_the_bytes_of_one_from_memory(rounds_folder):
    by_blocks = make(rounds_folder)
    assert make(rounds_folder, limit=10**6, fresh=True) == by_blocks


def test_a_kill_in_a_later_round_costs_one_block_at_the_most(rounds_folder):
    killed_after(rounds_folder, 9)  # in the last round; the file of the one before is still open
    again = Interrupted()
    found = runs(rounds_folder, progress=again)
    # Of the rounds that are no blocks, those of the last moments may be lost.
    assert 2_048 + 2 * BLOCK <= again.restored <= 4_096 + 2 * BLOCK
    assert_same(found, runs(rounds_folder))


@pytest.mark.parametrize("design", [SobolSequence(runs=2**18), Halton(runs=200_001, replicates=3)])
def test_parts_of_a_large_set_of_a_sequence_are_those_of_the_whole(design):
    size = 2**17 if isinstance(design, SobolSequence) else 70_001
    whole = design.draw(np.random.default_rng(3), size, 2)
    between = design.points_between(np.random.default_rng(3), size, 2)
    for start, stop in ((0, 65_536), (65_536, 70_000), (69_000, size), (7, 9)):
        np.testing.assert_array_equal(between(start, stop), whole[start:stop])


@pytest.fixture
def large(folder, expected):
    """The runs of an archive, read as one whose runs do not fit the memory."""
    import netCDF4

    write_tree(xr.DataTree.from_dict({"/runs/one": expected}), folder / "runs.nc")
    with netCDF4.Dataset(folder / "runs.nc") as root:
        return read_groups(root, LIMIT)["runs/one"].to_dataset(inherit=False)


def test_runs_stay_in_the_file_until_they_are_needed(large):
    lazy = {str(name) for name, each in large.variables.items() if not is_in_memory(each)}
    assert lazy == {"run", "x", "y", "z", "status"}


def test_parts_of_runs_are_those_of_the_whole(large, expected):
    rng = np.random.default_rng(3)
    for part in (slice(1_400, 1_600), rng.permutation(4_500)[:300], rng.random(4_500) < 0.3):
        for name in ("run", "x", "z", "status"):
            found = large.variables[name][part].values
            np.testing.assert_array_equal(found, expected.variables[name][part].values)
    blocks = [LoadedDataset(each).read(1_500, 3_000) for each in (large, expected)]
    assert_same(blocks[0][[*blocks[1].variables]], blocks[1])


def test_hashes_do_not_tell_a_file_from_memory(large, expected):
    both = [group_hashes(xr.DataTree.from_dict({"/": each})) for each in (large, expected)]
    assert both[0] == both[1]


def test_a_difference_of_one_run_among_many_is_found(large):
    other = large.compute()
    other["z"].values[3_700] = 5.0
    (line,) = diff_runs(large, other).outputs
    assert line.startswith("z of run 3700: ")
    assert line.endswith("and 5.0; 1 run differs")


def test_a_table_of_runs_by_parts_is_the_whole_one(folder):
    make(folder)
    tree = uqpen.open_archive(folder / "study.nc")
    parts = [*run_table_parts(tree)]
    assert [len(each) for each in parts] == [BLOCK] * 3
    assert pd.concat(parts, ignore_index=True).to_csv() == runs_table(tree).to_csv()
    for kind in ("csv", "json"):
        whole = table_content([runs_table(tree)], kind)
        assert b"".join(table_content(parts, kind)) == b"".join(whole)
