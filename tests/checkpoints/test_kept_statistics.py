"""Designs that keep statistics alone: the archive has no run of them, and says so where it must."""

import pytest
import xarray as xr
from click.testing import CliRunner
from interrupted_study import Interrupted

import uqpen
from uqpen.archive.write import write
from uqpen.checkpoints.make_archive import ResumeOptions, make_archive
from uqpen.cli.export import export
from uqpen.cli.show import report, show
from uqpen.core.errors import CheckpointError, StudyError
from uqpen.core.labels import BATCH_HASH
from uqpen.execution import run_count, status_counts
from uqpen.execution.omitted_runs import are_omitted, batch_hashes
from uqpen.results.failed_runs import failed_runs
from uqpen.study.load import parse_study
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.diff import diff_runs
from uqpen.verification.verify import verify

pytestmark = pytest.mark.processor

# Some runs fail; one output is a curve.
MODEL = """\
import numpy as np
def simulate(x, y):
    t = np.linspace(0, 1, 3)
    return {"z": np.where(x > 2.2, np.nan, x * y), "curve": x[:, None] * t}
"""
STUDY = """\
title = "Statistics alone"
seed = 11
[model]
python = "model.py:simulate"
vectorized = true
inputs = { x = "1", y = "m" }
[model.outputs]
z = "m"
curve = { unit = "1", along = { t = { unit = "s", from = 0, to = 1, size = 3 } } }
[inputs]
x = "0 ± 1"
y = "(0 ± 1) m"
[outputs.z]
exceeds = ["1 m"]
[designs.one]
kind = "monte-carlo"
runs = 2_500
keep = "statistics"
[designs.other]
kind = "latin-hypercube"
runs = 60
"""
ALL_KEPT = STUDY.replace('keep = "statistics"\n', "")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with the study, and its archive `study.nc`."""
    folder = tmp_path_factory.mktemp("kept_statistics")
    (folder / "model.py").write_text(MODEL)
    make(folder, STUDY)
    return folder


def make(folder, text, name="study.nc", resume=None, **options):
    study = parse_study(text, folder=folder)
    make_archive(study, folder / name, resume or ResumeOptions(reuse=None), **options)
    return (folder / name).read_bytes()


def by_command(command, *words):
    return CliRunner().invoke(command, [str(each) for each in words]).output


class TestArchive:
    def test_statistics_are_those_of_the_runs(self, made):
        make(made, ALL_KEPT, "kept.nc")
        found, kept = (uqpen.open_archive(made / name) for name in ("study.nc", "kept.nc"))
        for node in kept.subtree:
            if node.path not in ("/", "/runs/one"):
                dataset = node.to_dataset(inherit=False)
                assert found[node.path].to_dataset(inherit=False).identical(dataset)
        one, runs = found["runs/one"].to_dataset(), kept["runs/one"].to_dataset()
        assert are_omitted(one)
        assert one.sizes["run"] == 0
        assert run_count(one) == 2500
        assert status_counts(one) == status_counts(runs)
        assert one[BATCH_HASH].values.tolist() == [*batch_hashes(runs)]
        assert [*failed_runs(found, "one")] == [*failed_runs(kept, "one")]
        assert diff_runs(one, runs).points == ["the runs are only in the second archive"]

    @pytest.mark.parametrize("limit", [1_000, 10_000])
    def test_bytes_are_the_same_through_files_and_after_an_interruption(self, made, limit):
        with pytest.raises(KeyboardInterrupt):
            make(made, STUDY, "again.nc", runs_in_memory=limit, progress=Interrupted(1))
        assert (
            make(made, STUDY, "again.nc", runs_in_memory=limit) == (made / "study.nc").read_bytes()
        )

    def test_runs_of_an_interrupted_start_serve_either_setting(self, made):
        with pytest.raises(KeyboardInterrupt):
            make(made, ALL_KEPT, "changed.nc", progress=Interrupted(1))
        assert make(made, STUDY, "changed.nc") == (made / "study.nc").read_bytes()


class TestVerification:
    def test_batches_are_made_again(self, made):
        results = {each.name: each for each in verify(made / "study.nc", runs=None, trust=True)}
        assert results["batches"].verdict is CheckOutcome.EQUAL
        assert "3 of 3 batches" in results["batches"].text
        assert results["runs"].verdict is CheckOutcome.EQUAL

    def test_another_run_is_found(self, made):
        tree = uqpen.open_archive(made / "study.nc")
        hashes = tree["runs/one"][BATCH_HASH].values.copy()
        hashes[1] = hashes[0]
        one = tree["runs/one"].to_dataset()
        one[BATCH_HASH] = one[BATCH_HASH].copy(data=hashes)
        groups = {node.path: node.to_dataset(inherit=False) for node in tree.subtree}
        write(xr.DataTree.from_dict({**groups, "/runs/one": one}), made / "false.nc")
        (found,) = (
            each
            for each in verify(made / "false.nc", runs=None, trust=True)
            if each.name == "batches"
        )
        assert found.verdict is CheckOutcome.DIFFERENT
        assert found.details == ("one: runs 1024 to 2047 are others now",)


class TestReaders:
    def test_the_page_and_the_screen_show_what_there_is(self, made):
        assert "34 not finite   z is nan" in by_command(show, made / "study.nc")
        assert "report: " in by_command(report, made / "study.nc", "-o", made / "page.html")
        assert "The runs of one are not in the archive" in (made / "page.html").read_text()

    def test_a_table_of_runs_names_the_design_that_it_lacks(self, made):
        found = by_command(export, made / "study.nc", "--runs", "-o", made / "runs.csv")
        assert "the runs of one are not in it, only their statistics" in found
        assert "60 rows" in found

    def test_named_archives_say_why_no_run_is_taken(self, made):
        text = STUDY.partition("[designs.other]")[0]
        make(made, text, "one.nc")
        with pytest.raises(CheckpointError, match="one: the archive has only their statistics"):
            make(made, text, "new.nc", ResumeOptions(reuse=[made / "one.nc"]))


class TestMistakes:
    def test_a_surrogate_needs_runs(self, made):
        text = STUDY + '[surrogates.fit]\nkind = "polynomial-chaos"\ndesign = "one"\n'
        with pytest.raises(StudyError) as error:
            parse_study(text, folder=made)
        (problem,) = error.value.problems
        assert problem.path == ("surrogates", "fit", "design")
        assert "keeps statistics alone" in problem.found

    def test_runs_that_decide_their_number_are_kept(self, made):
        rule = "runs = 2_500\nkeep"
        text = STUDY.replace(rule, 'accept = "P(z > 1 m) < 0.5"\nat_most = 2_000\nkeep')
        with pytest.raises(StudyError, match='"runs" beside accept'):
            parse_study(text, folder=made)
