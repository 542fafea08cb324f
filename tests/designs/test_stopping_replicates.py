"""Replicated designs that stop at a wanted precision: their points, estimates and settings."""

import numpy as np
import pytest
import xarray as xr
from interrupted_study import Interrupted
from study_text import study_text

import uqpen
from uqpen.archive.estimates import UnpackedStatistics
from uqpen.checkpoints.make_archive import make_archive
from uqpen.core.errors import SettingsError, StudyError
from uqpen.core.status import Status
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
from uqpen.designs.stopping.precision import Precision
from uqpen.execution.processes import processes
from uqpen.statistics.convergence import sample_so_far
from uqpen.testing import check_design, check_extension, example_joint_distribution

RULE = Precision({"y": {"mean": 0.05}})
NEVER = Precision({"y": {"mean": 1e-9}})
# A design that stops, and the plain one of the size at which it ends in any case.
PAIRS = {
    "sobol-sequence": (SobolSequence(until=NEVER, at_most=1_500), SobolSequence(1_024, 32)),
    "halton": (Halton(replicates=40, until=NEVER, at_most=1_040), Halton(1_040, 40)),
    "latin-hypercube": (LatinHypercube(until=NEVER, at_most=2_000), LatinHypercube(1_040, 40)),
}
kinds = pytest.mark.parametrize("kind", PAIRS)

STUDY = study_text(
    "ishigami",
    seed=3,
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    constraints={"keep": ["x1 < 2.9"]},
    outputs={"y": {"exceeds": [5]}},
    designs={
        "one": {
            "kind": "sobol-sequence",
            "until": {"y": {"mean": 0.08, "exceeds": {"5": "2 %"}}},
            "at_most": 20_000,
        }
    },
)


def fails_at_times(length, share):
    if length * share % 0.05 < 0.002:
        raise ValueError("no equilibrium")
    return {"y": length + share**2}


def run(design):
    """Run a design over a constrained joint distribution; some runs fail."""
    return uqpen.run(
        uqpen.Study(
            model=fails_at_times,
            inputs={"length": uqpen.Uniform(0, 1), "share": uqpen.Normal(0.0, 1.0)},
            constraints=["length + share < 2"],
            outputs={"y": uqpen.OutputSpec("1", exceeds=[1])},
            designs={"one": design},
            seed=1,
        )
    )


def rows(runs):
    """Return replicate, inputs, status and output of each run, in an order of their own."""
    names = ("replicate", "length", "share", "status")
    return sorted(zip(*(runs[name].values.tolist() for name in names), strict=True))


@pytest.mark.slow
@kinds
def test_points_and_estimates_are_those_of_a_plain_design_of_its_size(kind):
    tree, plain = (run(design) for design in PAIRS[kind])
    made = tree["runs/one"].to_dataset()
    assert np.bincount(made["round"].values).tolist() == [made.sizes["run"] // 2] * 2
    assert {Status.FAILED, Status.INADMISSIBLE} <= set(made["status"].values.tolist())
    assert rows(made) == rows(plain["runs/one"].to_dataset())
    found, same = (
        UnpackedStatistics(each["statistics/one/y"].to_dataset()) for each in (tree, plain)
    )
    for name in ("mean", "std", "quantile", "exceedance", "convergence_mean"):
        np.testing.assert_allclose(found[name].values, same[name].values, rtol=1e-9)
    assert "not certified" not in str(found["mean"]["note"].values)
    assert "not certified" in str(found["exceedance"]["note"].values[0])


@kinds
def test_it_meets_the_contract_and_keeps_the_points_of_a_smaller_design(kind):
    stopped, plain = PAIRS[kind]
    joint = example_joint_distribution()
    check_design(stopped, joint)
    check_extension(plain, stopped, joint)
    check_extension(stopped, plain, joint)
    assert stopped.extension(plain, joint).kept == plain.run_count(joint)
    assert stopped.ends_early


@pytest.mark.parametrize(
    ("design", "first", "most"),
    [
        (SobolSequence(until=RULE, at_most=100_000), 512, 65_536),
        (SobolSequence(replicates=40, until=RULE, at_most=1_280), 640, 1_280),
        (SobolSequence(2_048, until=RULE, at_most=5_000), 2_048, 4_096),
        (Halton(replicates=50, until=RULE, at_most=3_000), 550, 2_200),
        (LatinHypercube(until=RULE, at_most=3_000), 520, 2_080),
        (LatinHypercube(2_000, until=RULE, at_most=4_000), 2_000, 4_000),
    ],
)
def test_looks_double_as_often_as_the_largest_number_allows(design, first, most):
    assert design.first_runs == first
    assert design.run_count(example_joint_distribution()) == most


@pytest.mark.parametrize(
    ("make", "key", "expected"),
    [
        (lambda: SobolSequence(), "runs", "at most 1_000_000_000_000; or until with at_most"),
        (lambda: Halton(320, at_most=5_000), "at_most", "until beside it"),
        (lambda: Halton(until=RULE), "at_most", "the largest number"),
        (lambda: Halton(until=RULE, at_most=1_000), "at_most", "at least 1024, beside until"),
        (lambda: SobolSequence(512, 16, RULE, 5_000), "replicates", "at least 32 beside until: of"),
        (lambda: LatinHypercube(500, 10, "none", RULE, 5_000), "replicates", "at least 20 beside"),
        (lambda: LatinHypercube(500, 20, "none", RULE, 5_000), "runs", "at least 512 at the first"),
        (lambda: LatinHypercube(None, 20, "random-cd", RULE, 5_000), "optimization", "so many"),
        (lambda: SobolSequence(768, 32, RULE, 5_000), "runs", "times a power of two"),
    ],
)
def test_settings_that_do_not_go_together_are_reported(make, key, expected):
    with pytest.raises(SettingsError) as caught:
        make()
    (problem,) = caught.value.problems
    assert problem.key == key
    assert expected in problem.expected


@pytest.mark.parametrize("kind", ["sobol-sequence", "halton", "latin-hypercube"])
def test_a_quantile_is_refused_before_any_run(kind):
    text = STUDY.replace("sobol-sequence", kind).replace("mean = 0.08", 'quantile_95 = "2 %"')
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(text)
    (problem,) = caught.value.problems
    assert (problem.key, problem.found) == ("designs.one.until.y", "the 0.95 quantile")
    assert 'or kind = "monte-carlo": over replicates' in problem.expected


@pytest.mark.processor
@pytest.mark.slow
def test_the_bytes_are_the_same_for_workers_and_after_an_interruption(tmp_path):
    study = uqpen.parse_study(STUDY)
    one, two, again = (tmp_path / name / "study.nc" for name in ("one", "two", "again"))
    for path in (one, two, again):
        path.parent.mkdir()
    make_archive(study, one)
    with processes(2) as workers:
        make_archive(study, two, map=workers)
    with pytest.raises(KeyboardInterrupt):
        make_archive(study, again, progress=Interrupted(2))
    make_archive(study, again)
    assert one.read_bytes() == two.read_bytes() == again.read_bytes()
    runs = uqpen.open_archive(one)["runs/one"]
    assert runs.sizes["run"] in (1_024, 2_048, 4_096)
    assert "intervals over 32 replicates cover" in runs.attrs["stopping_note"]


def test_while_replicates_grow_those_of_the_most_common_size_are_a_sample():
    replicate = np.concatenate([np.repeat(np.arange(8), 4), [0, 0, 0, 0, 1, 1]])
    runs = xr.Dataset(
        {"y": ("run", np.arange(38.0))},
        coords={"replicate": ("run", replicate)},
        attrs={"sampling": "stratified"},
    )
    (found, reason) = sample_so_far(runs, is_complete=False)
    assert found is not None, reason
    assert sorted(set(found["replicate"].values.tolist())) == [2, 3, 4, 5, 6, 7]
