"""Importance sampling of a rare event: weights, mixtures, doubts."""

import math

import numpy as np
import pytest
from rare_event_studies import half_space, probability
from rare_event_studies import study as study_by
from scipy import special, stats

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.core.labels import (
    DENSITY_RATIO,
    MIXTURE_COMPONENT,
    RARE_EVENT_METHOD,
    REPLICATE,
    RUN,
    SAMPLING_STAGE,
    SEARCH_START,
)
from uqpen.core.streams import Stream
from uqpen.designs.rare_events.importance_sampling import (
    GaussianComponent,
    GaussianMixture,
    log_normal_density,
)
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.statistics.joint_probability import joint_probabilities


def study(function=half_space, event=f"depth > {5 * 2**0.5!r} m", *, samples=400, start="form"):
    return study_by(uqpen.ImportanceSampling(event=event, samples=samples, start=start), function)


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study())


def contains(found, exact):
    """Check that the interval contains a value, and that the estimate is near for so few runs."""
    estimate, lower, upper = found.values
    return bool(lower <= exact <= upper and 0.7 * exact < estimate < 1.4 * exact)


def test_the_method_is_the_one_that_the_runs_name(tree):
    """A coordinate that another method has as well makes them no runs of that."""
    runs = tree["runs/rare"].to_dataset()
    assert runs.attrs[RARE_EVENT_METHOD] == "importance-sampling"
    alike = runs.assign_coords({SEARCH_START: (RUN, np.zeros(runs.sizes[RUN], dtype=np.int64))})
    found = joint_probabilities(alike, (), 0.999)["joint_probability"]
    np.testing.assert_array_equal(found[0], probability(tree))
    # A file of any origin may name no method, or one whose coordinates it lacks.
    for name in ("line-sampling", "form", "subset-simulation", "active-learning"):
        other = runs.assign_attrs({RARE_EVENT_METHOD: name})
        assert joint_probabilities(other, (), 0.999) == {}


def test_the_ratio_of_densities_has_the_mean_one(tree):
    runs = tree["runs/rare"].to_dataset()
    stage, replicate = runs[SAMPLING_STAGE].values, runs[REPLICATE].values
    assert (np.isnan(runs[DENSITY_RATIO].values) == (stage == 0)).all()
    assert ((runs[MIXTURE_COMPONENT].values == -1) == (stage == 0)).all()
    ratio = runs[DENSITY_RATIO].values
    first = [ratio[(replicate == each) & (stage == 1)] for each in range(5)]
    # The nominal part bounds the ratio by 10, so its mean scatters by at most √(10/n).
    joined = np.concatenate(first)
    assert abs(joined.mean() - 1) < 4 * math.sqrt(10 / len(joined))


def test_draws_and_density_of_a_mixture_agree():
    covariance = np.array([[2.0, 0.5], [0.5, 1.0]])
    parts = (
        GaussianComponent(np.zeros(2), 4 * np.eye(2)),
        GaussianComponent(np.array([1.0, 0.0]), covariance),
    )
    mixture = GaussianMixture.of_shares(parts, np.array([1.0, 2.0]), 100_001)
    assert mixture.counts.sum() == 100_001
    points = mixture.draw(Stream(1).generator())
    weights = np.exp(log_normal_density(points) - mixture.log_density(points))
    # Moments of a standard normal distribution; the weights are below 12, so four standard errors
    # are below 0.05.
    assert abs(weights.mean() - 1) < 0.05
    assert np.allclose((weights[:, np.newaxis] * points).mean(axis=0), 0, atol=0.05)
    assert np.allclose((weights[:, np.newaxis] * points**2).mean(axis=0), 1, atol=0.05)


@pytest.mark.parametrize("start", ["form", "cross-entropy"])
def test_modes_at_different_distances_are_all_met(start):
    def two(a, b):
        return {"depth": np.maximum(a - 3, -a - 3.5), "speed": b}

    exact = special.ndtr(-3.0) + special.ndtr(-3.5)
    found = probability(uqpen.run(study(two, "depth > 0 m", start=start, samples=800)))
    assert contains(found, exact)


def test_few_runs_in_a_replicate_are_reported():
    few = probability(uqpen.run(study(event="depth > 3 m", samples=400)))
    assert "replicates of fewer than 1000 runs" in few.attrs["note"]
    enough = probability(uqpen.run(study(event="depth > 3 m", samples=1000)))
    assert "replicates of fewer" not in enough.attrs["note"]


def test_the_note_bounds_what_no_draw_met(tree):
    note = probability(tree).attrs["note"]
    assert "parts of the event that no draw met are not in it" in note
    assert "(5 standard deviations) has a probability below" in note
    assert "parts of the event that no draw met" in str(list(answer(ArchiveView(tree, "")))).lower()
    assert not list(find_faults(tree))


def test_replicates_that_differ_by_more_than_their_draws_explain_are_reported(tree):
    runs = tree["runs/rare"].to_dataset()
    ratio = runs[DENSITY_RATIO] * np.where(runs[REPLICATE] == 0, 4.0, 1.0)
    other = runs.assign_coords({DENSITY_RATIO: ratio})
    found = joint_probabilities(other, (), 0.999)["joint_probability"]
    note = str(found.coords["note"].values[0])
    assert "some have met a part of the event that others have not" in note


def test_a_part_that_no_search_leads_to_is_in_the_interval_or_a_note_says_so():
    # A small region where the output jumps, and a hundred times likelier than the rest.
    def spot(a, b):
        is_spot = (a + 2) ** 2 + (b + 2) ** 2 < 0.5
        return {"depth": np.where(is_spot, 5.0, a), "speed": b}

    found = probability(uqpen.run(study(spot, "depth > 4.5 m", samples=200)))
    exact = stats.ncx2.cdf(0.5, 2, 8.0) + special.ndtr(-4.5)
    is_reported = "some have met a part of the event that others have not" in found.attrs["note"]
    assert is_reported or found.values[1] <= exact <= found.values[2]
