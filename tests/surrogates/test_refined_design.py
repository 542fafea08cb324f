"""A surrogate's design goes on where the surrogate expects to err."""

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.core.errors import StudyError
from uqpen.core.labels import REFINED_FOR, ROUND, RUN, STATUS, WEIGHT
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.study.summary import design_rows
from uqpen.verification.check_result import CheckOutcome
from uqpen.workflow import Progress, run, run_design

DESIGN = """
[outputs.y]
exceeds = ["1.5"]
[designs.some]
kind = "monte-carlo"
runs = 40
[surrogates.pce]
kind = "polynomial-chaos"
design = "some"
order = 3
method = "least-squares"
"""
REFINED = f"{DESIGN}refine = 30\n"
# A jump in a corner, where no polynomial follows.
BODY = "a + 2.0 * ((a > 0.7) & (b > 0.6))"


def refined(study_of, text=REFINED, body=BODY):
    return study_of(body, text, a=(0, 1), b=(0, 1))


def runs_of(study, map=map):
    stream = Stream(study.seed, "designs", "some")
    return run_design(study, study.designs["some"], stream, map=map, progress=Progress())[""]


def test_the_first_round_is_the_plain_design_and_all_runs_are_counted(study_of):
    study = refined(study_of)
    assert study.runs == 70
    assert design_rows(study) == [("some", "monte-carlo, refined by pce", "70")]
    found, plain = runs_of(study), runs_of(refined(study_of, DESIGN))
    assert found.attrs[REFINED_FOR] == "pce"
    assert np.bincount(found[ROUND]).tolist() == [40, 20, 10]
    first = found.isel({RUN: slice(40)})
    assert (first[WEIGHT] == 1).all()
    for name in ("a", "b", "y"):
        assert (first[name].values == plain[name].values).all()


def test_runs_are_placed_where_the_surrogate_errs(study_of):
    text, body = DESIGN + "refine = 200\n", "np.exp(4 * a * b)"
    runs = runs_of(refined(study_of, text, body))
    placed = runs.isel({RUN: np.flatnonzero(runs[WEIGHT] != 1)})
    assert placed.sizes[RUN] > 50
    # A quarter of the draws of the inputs, and most of the error.
    assert float(((placed.a > 0.5) & (placed.b > 0.5)).mean()) > 0.27
    assert float(runs[WEIGHT].mean()) == pytest.approx(1, abs=0.1)


def test_placed_runs_follow_from_the_seed_alone(study_of):
    def backwards(work, batches):
        return reversed([work(each) for each in reversed([*batches])])

    study = refined(study_of)
    xr.testing.assert_identical(runs_of(study), runs_of(study, backwards))


def test_failed_runs_are_data_and_an_archive_proves_itself(study_of, tmp_path):
    body = f"np.where((a > 0.8) & (b > 0.9), np.nan, {BODY})"
    tree = run(refined(study_of, body=body))
    runs = tree["runs/some"].to_dataset()
    assert runs.sizes[RUN] == 70
    assert (runs[STATUS] == Status.NOT_FINITE).any()
    mean = tree["statistics/pce/y"].to_dataset()["mean"]
    assert np.isfinite(mean.values).all()
    placed = int((runs[WEIGHT].values[runs[STATUS].values == Status.OK] != 1).sum())
    assert f"{placed} of them placed where the surrogate" in mean.attrs["estimator"]
    uqpen.write(tree, tmp_path / "refined.nc")
    found = {each.name: each.verdict for each in uqpen.verify(tmp_path / "refined.nc", trust=True)}
    assert CheckOutcome.DIFFERENT not in found.values(), found
    assert found["runs"] == found["statistics"] == CheckOutcome.EQUAL


def test_inadmissible_points_are_not_placed(study_of):
    runs = runs_of(refined(study_of, f'[constraints]\nkeep = ["a + b < 1.2"]\n{REFINED}'))
    is_inadmissible = runs[STATUS].values == Status.INADMISSIBLE
    assert is_inadmissible[:40].any()
    assert not is_inadmissible[40:].any()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            REFINED.replace('"monte-carlo"', '"latin-hypercube"'),
            "surrogates.pce.refine found a design of kind latin-hypercube expected a design of "
            "kind monte-carlo with runs: points that are placed have weights, and weights are of "
            "independent draws",
        ),
        (REFINED.replace("30", "3"), "refine found 3 expected a whole number, at least 10"),
        (f'{DESIGN}refine_for = "mean"', "expected the number of further runs, beside refine_for"),
        (
            f'{REFINED}refine_for = "probabilities"\n'.replace('exceeds = ["1.5"]', ""),
            'refine_for found "probabilities" expected an output with a threshold',
        ),
        (
            REFINED + REFINED[REFINED.index("[surrogates") :].replace(".pce", ".other"),
            "surrogates.other.refine found a design that pce refines already",
        ),
    ],
)
def test_a_refinement_that_is_not_possible_says_so(study_of, text, expected):
    with pytest.raises(StudyError) as caught:
        refined(study_of, text)
    assert expected in " ".join(str(caught.value).split())
