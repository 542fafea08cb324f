"""Scores of a black-box challenge: exact ones, and what makes an honest interval the best one."""

import numpy as np
import pytest
import scipy

challenge = pytest.importorskip("challenge", reason="the folder of benchmarks is not here")


def test_an_interval_that_covers_costs_its_width():
    scores = challenge.interval_score(np.array([1.0, 2.0]), np.array([4.0, 3.0]), 2.5)
    assert scores.tolist() == [3.0, 1.0]


def test_a_miss_costs_forty_times_its_distance():
    # 2 / (1 - 0.95) = 40, on either side.
    scores = challenge.interval_score(np.array([1.0, 3.0]), np.array([2.0, 4.0]), 2.5)
    assert scores == pytest.approx([1 + 40 * 0.5, 1 + 40 * 0.5], rel=1e-12)


def test_the_interval_that_one_believes_in_has_the_best_expected_score():
    # The truth is standard normal: the expectation is a mean over 2 000 strata of it.
    truths = scipy.special.ndtri((np.arange(2_000) + 0.5) / 2_000)
    means = {
        half: np.mean(
            [challenge.interval_score(np.array(-half), np.array(half), t) for t in truths]
        )
        for half in (1.0, 1.5, 1.959964, 2.5, 4.0)
    }
    assert min(means, key=means.get) == 1.959964


def test_accuracy_and_coverage_are_relative_to_the_truth():
    answers = [
        challenge.Answer("a", "wall", 0, 100, 0.11, 0.09, 0.13),
        challenge.Answer("a", "wall", 1, 300, 0.09, 0.105, 0.2),
        challenge.Answer("a", "wall", 2, 200, 0.10, np.nan, np.nan),
    ]
    found = challenge.score(answers, 0.1)
    assert (found.repeats, found.refused, found.runs) == (3, 1, 200)
    assert found.bias == pytest.approx(0.0, abs=1e-12)
    assert found.error == pytest.approx(np.sqrt(0.02 / 3), rel=1e-12)
    assert found.coverage[0] == 0.5
    # Of one in two: exact binomial ends, the roots of 1 - (1-p)² = 0.025 and its mirror image.
    assert found.coverage[1] == pytest.approx(1 - np.sqrt(0.975), rel=1e-9)
    assert found.interval_score[0] == pytest.approx((0.4 + 0.95 + 40 * 0.05) / 2, rel=1e-12)


def test_the_table_ranks_by_interval_score_and_refusals_come_last(tmp_path):
    (tmp_path / "answers.csv").write_text(
        "participant,problem,repeat,runs,estimate,lower,upper\n"
        "too narrow,wall,0,500,0.12,0.119,0.121\n"
        "too narrow,wall,1,500,0.08,0.079,0.081\n"
        "honest,wall,0,500,0.12,0.09,0.15\n"
        "honest,wall,1,500,0.08,0.06,0.11\n"
        "silent,wall,0,500,0.10,,\n"
        "silent,wall,1,500,0.10,,\n"
    )
    (tmp_path / "truths.csv").write_text("problem,truth\nwall,0.1\n")
    answers = challenge.read_answers([tmp_path / "answers.csv"])
    lines = list(challenge.page(answers, challenge.read_truths(tmp_path / "truths.csv")))
    assert [line.split(" | ")[1] for line in lines[2:]] == ["honest", "too narrow", "silent"]
    assert "| 100.0 % (15.8 to 100.0 %) |" in lines[2]
    assert "| 0.0 % (0.0 to 84.2 %) |" in lines[3]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("a,wall,0,500,much,0,1", "could not convert string to float: 'much'"),
        ("a,wall,0,500,0.1,0.2,0.1", "the lower end is above the upper one"),
        ("a,wall", "no answer"),
    ],
)
def test_a_mistake_is_reported_with_its_line(tmp_path, line, message):
    path = tmp_path / "answers.csv"
    path.write_text(f"participant,problem,repeat,runs,estimate,lower,upper\n{line}\n")
    with pytest.raises(ValueError, match=rf"answers\.csv:2: .*{message}"):
        challenge.read_answers([path])
