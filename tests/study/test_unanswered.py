"""What a study asks for and no design of it answers, told before runs are made."""

import pytest

from uqpen.study.summary import unanswered_lines

ASKED = (
    "[outputs.y]\nexceeds = [3]\nbelow = [-9]\nquantiles = [0.9]\nhold = [0.95]\n[designs.some]\n"
)
BOUNDS = 'kind = "interval-bounds"\nevents = ["y > 3"]\n'
SUBSET = 'kind = "subset-simulation"\nevent = "y > 3"\n'
PROBABILITIES = "P(> 3), P(< -9)"
HELD = "value held with 0.95"


@pytest.mark.parametrize(
    ("design", "x", "left"),
    [
        (BOUNDS, "{ interval = [1, 2] }", f"{PROBABILITIES}, {HELD}, quantile 0.9"),
        (BOUNDS + "quantiles = { y = [0.9] }", "{ interval = [1, 2] }", f"{PROBABILITIES}, {HELD}"),
        (SUBSET, "0 ± 1", PROBABILITIES),
        ('kind = "importance-sampling"\nevent = "y > 3"', "0 ± 1",
         f"{PROBABILITIES}, {HELD}, quantile 0.9"),
        ('kind = "morris"\ntrajectories = 4', "0 ± 1", f"{PROBABILITIES}, {HELD}, quantile 0.9"),
    ],
)  # fmt: skip
def test_answers_without_a_sample_are_told(study_of, design, x, left):
    (line,) = unanswered_lines(study_of("x + b", ASKED + design, x=x, b="0 ± 1"))
    assert line.startswith(f"warning: nothing answers {left} of y: no design is a sample")


@pytest.mark.parametrize(
    ("text", "x"),
    [
        (ASKED + 'kind = "monte-carlo"\nruns = 10', "0 ± 1"),
        (ASKED + 'kind = "monte-carlo"\nruns = 10', "{ normal = { mean = [0, 1], std = 1 } }"),
        (ASKED + SUBSET + '[designs.other]\nkind = "monte-carlo"\nruns = 10', "0 ± 1"),
        # Nobody asks for the quantiles that all studies have.
        (f"[designs.some]\n{BOUNDS}", "{ interval = [1, 2] }"),
        (
            ASKED
            + 'kind = "quadrature"\norder = 2\n'
            + '[surrogates.s]\nkind = "polynomial-chaos"\ndesign = "some"',
            "0 ± 1",
        ),
    ],
)
def test_a_sample_leaves_nothing_open(study_of, text, x):
    assert not [*unanswered_lines(study_of("x + b", text, x=x, b="0 ± 1"))]
