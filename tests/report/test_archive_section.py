"""The last section: the study, its files, inputs, designs, warnings, and what made the archive."""

import numpy as np
import pytest
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.report.blocks import Heading, Listing, Remarks, Table, Text
from uqpen.report.sections.archive import archive, archive_notes
from uqpen.results.archive_view import ArchiveView

pytestmark = pytest.mark.slow


def _tables(blocks):
    return {block.table.title: block.table for block in blocks if isinstance(block, Table)}


def _listings(blocks):
    return {block.title: block for block in blocks if isinstance(block, Listing)}


def test_the_study_comes_first_word_for_word(archives):
    tree = archives["schema_1"]
    first, *_ = archive(ArchiveView(tree, ""))
    assert first == Listing("The study: schema_1", tree.attrs["study_text"])


def test_inputs_are_reported_as_run_and_as_written(archives):
    tree = archives["beam"]
    table = _tables(archive(ArchiveView(tree, "")))[
        "Inputs, over the runs of only, failed ones included"
    ]
    loads = read_group(tree, "runs", "only")["load"].values / 1e3
    drawn = [f"{np.median(loads):.4g}", f"{loads.min():.4g} … {loads.max():.4g}"]
    assert table.rows == [
        ("load [kN]", ["load", *drawn, "uniform: (lower: 10 kN, upper: 20 kN)"]),
        ("span [m]", ["span", "2.994", "2.804 … 3.256", "(3 ± 0.1) m"]),
    ]


def test_designs_say_what_they_are_for(archives):
    table = _tables(archive(ArchiveView(archives["schema_1"], "")))["Designs"]
    assert table.columns == ["points", "runs", "completed", "replicates", "purpose"]
    reported = {name: [*map(cells.__getitem__, (0, 1, 2, -1))] for name, cells in table.rows}
    expected = """\
monte_carlo | independent | 20 | 19 | a sample of the inputs; checks chaos
latin_hypercube | stratified | 40 | 40 | a sample of the inputs, spread evenly; trains chaos
blocks | pick-freeze | 40 | 40 | Sobol' indices; two of its matrices are a sample of the inputs
trajectories | trajectories | 20 | 20 | a screening of the inputs by elementary effects; no sample
steps | steps | 7 | 7 | responses at the nominal point; no sample
"""
    rows = [line.split(" | ") for line in expected.splitlines()]
    assert reported == {name: cells for name, *cells in rows}


def test_what_made_it_is_reported_whole(archives):
    tree = archives["schema_1"]
    blocks = list(archive(ArchiveView(tree, "")))
    reported = {name: cells[0] for name, cells in _tables(blocks)["Provenance"].rows}
    assert reported["seed"] == "11"
    assert reported["SHA-256 of the study's text"] == tree.attrs["study_sha256"]
    assert reported["model name"] == "ishigami"
    assert reported["model source SHA-256"] == tree.attrs["model_source_sha256"]
    assert reported["version of numpy"] == tree.attrs["version_numpy"]
    assert reported["schema of the archive"] == "1"
    listings = _listings(blocks)
    assert "uqpen verify ARCHIVE\n" in listings["Commands"].text
    hashes = listings["SHA-256 of the content of each of the archive's groups"]
    assert hashes.text == tree.attrs["content_sha256"]
    assert hashes.is_folded


def test_what_several_models_share_is_reported_once(archives):
    blocks = list(archive(ArchiveView(archives["schema_1_several"], "one")))
    headings = [block.text for block in blocks if isinstance(block, Heading)]
    assert headings == ["one", "other", "The archive of all models"]
    titles = [block.table.title for block in blocks if isinstance(block, Table)]
    of_model = ["Model", "Inputs, over the runs of monte_carlo, failed ones included", "Designs"]
    assert titles == ["Files that the study names", *of_model, *of_model, "Provenance"]
    # A model may be given an input of its own.
    other = _tables(blocks)["Inputs, over the runs of monte_carlo, failed ones included"]
    assert other.rows[0] == ("x1", ["x1", "0.5", "–", "0.5"])
    files = _tables(blocks)["Files that the study names"]
    named = ["cubic.py", "measured.csv", "points.csv", "powers.py"]
    assert [label for label, _ in files.rows] == named
    size, place, digest = files.rows[3][1]
    assert (size, place, digest[:8]) == ("92", "in the archive", "efd270c3")
    kept = _listings(blocks)["powers.py"]
    assert kept.is_folded
    assert kept.text.endswith("def cube(x: float) -> float:\n    return x**3\n")


def test_warnings_are_counted(archives):
    assert archive_notes(archives["beam"])[:3] == (
        "only: 18.3 % of the admissible runs did not complete.",
        "4 estimates: only 98 runs: the coverage may be below nominal",
        "4 estimates: fewer than 200 runs are too few to detect a heavy tail; "
        "see the rank correlations",
    )
    reported = archive_notes(archives["schema_1"])
    assert reported[0] == "22 estimates: 19 runs are too few"
    assert (
        "7 estimates: no correction by runs is known for it: this is the surrogate's own figure"
        in reported
    )
    # What is published elsewhere is no warning.
    assert not any("published" in line for line in reported)


def test_warnings_come_before_provenance(archives):
    blocks = list(archive(ArchiveView(archives["beam"], "")))
    (place,) = [n for n, block in enumerate(blocks) if isinstance(block, Remarks)]
    after = blocks[place + 1]
    assert isinstance(after, Table)
    assert after.table.title == "Provenance"


@pytest.mark.parametrize("text", ["no TOML [", 'inputs = "none"', "a = " + "[" * 9_999])
def test_a_study_that_cannot_be_read_is_shown_all_the_same(archives, text):
    tree = archives["beam"].copy()
    tree.attrs = {**tree.attrs, "study_text": text}
    blocks = list(archive(ArchiveView(tree, "")))
    assert blocks[0] == Listing("The study: study", text)
    inputs = _tables(blocks)["Inputs, over the runs of only, failed ones included"]
    assert [cells[-1] for _, cells in inputs.rows] == ["–", "–"]


def test_long_texts_are_cut_and_say_so(archives):
    tree = archives["beam"].copy()
    tree.attrs = {**tree.attrs, "study_text": "#" * 30_000}
    first, *_ = archive(ArchiveView(tree, ""))
    assert first == Listing(
        "The study: study (the first 20\u202f000 of 30\u202f000 characters)", "#" * 20_000
    )


def test_texts_of_many_files_are_left_in_the_archive(archives):
    tree = archives["schema_1_several"].copy()
    files = read_group(tree, "files")
    many = xr.concat([files] * 3, "file")
    tree["files"] = xr.DataTree(many)
    blocks = list(archive(ArchiveView(tree, "one")))
    assert Text("The archive has the texts of 2 more files, which are not shown here.") in blocks
