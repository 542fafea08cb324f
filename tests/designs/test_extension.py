"""A larger design keeps the points of a smaller one to the bit, and says where it does not."""

from collections import Counter

import chaospy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqpen
from uqpen.core.labels import RUN, STATUS
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.design import Extension
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.one_at_a_time import Morris
from uqpen.designs.quadrature import FullFactorial
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
from uqpen.designs.rounds import run_rounds
from uqpen.designs.saltelli import Saltelli
from uqpen.designs.stopping.precision import Precision
from uqpen.testing import check_extension, example_joint_distribution

pytestmark = pytest.mark.processor

# Designs that grow with both numbers, of replicates and of points in each where there are any.
SHAPES = {
    "monte-carlo": lambda r, n: MonteCarlo(1 + 7 * r * n),
    "latin-hypercube": lambda r, _: LatinHypercube(20 * (r + 1), r + 1),
    "sobol-sequence": lambda r, n: SobolSequence((r + 2) << (n + 1), r + 2),
    "halton": lambda r, n: Halton((r + 2) * (n + 2), r + 2),
    "saltelli": lambda r, n: Saltelli((r + 2) << (n + 1), r + 2),
    "pairs": lambda r, n: Saltelli((r + 2) << (n + 1), r + 2, second_order=n > 2),
    "morris": lambda r, n: Morris(2 + r + n, 6),
}
SAMPLES = ("monte-carlo", "latin-hypercube", "sobol-sequence", "halton")
SIZES = st.tuples(st.integers(0, 4), st.integers(0, 5))


def joint_of(inputs, **others):
    def model(a, b, c):
        return {"y": a + b + c}

    return uqpen.Study(
        model=model,
        inputs=inputs,
        outputs={"y": "1"},
        designs={"mc": uqpen.MonteCarlo(runs=2)},
        seed=1,
        **others,
    ).joint


NORMAL, WEIBULL = uqpen.Normal(2.0, 0.5), uqpen.Weibull(1.7, 2.0)
JOINTS = {
    "independent": example_joint_distribution(),
    "discrete": joint_of({"a": uqpen.Discrete([1, 2], [1, 3]), "b": NORMAL, "c": WEIBULL}),
    "truncated": joint_of(
        {"a": uqpen.Truncated(NORMAL, 1.0, 2.5), "b": uqpen.Gamma(2.0, 0.5), "c": 1.0}
    ),
    "copula": joint_of(
        {"a": NORMAL, "b": WEIBULL, "c": uqpen.LogUniform(0.1, 30.0)},
        dependence={"copula": "gumbel", "inputs": ["a", "c"], "theta": 2.0},
    ),
    "joint": joint_of({("a", "b"): chaospy.MvNormal([1, 2], [[1, 0.5], [0.5, 2]]), "c": NORMAL}),
}


@pytest.mark.parametrize("kind", SHAPES)
@settings(max_examples=10)
@given(size=SIZES, more=SIZES, joint=st.sampled_from(sorted(JOINTS)))
def test_a_larger_design_keeps_all_points(kind, size, more, joint):
    inputs = JOINTS[joint if kind in SAMPLES else "discrete"]
    earlier = SHAPES[kind](*size)
    new = SHAPES[kind](size[0] + more[0], size[1] + more[1])
    assert new.extension(earlier, inputs).kept == earlier.run_count(inputs)
    check_extension(new, earlier, inputs)


@st.composite
def pairs_of_designs(draw):
    """Two designs of a class, whose settings have nothing to do with each other."""
    replicates, each = st.integers(2, 6), st.integers(2, 12)
    kinds = [
        lambda: Halton((r := draw(replicates)) * draw(each), r),
        lambda: SobolSequence((r := draw(replicates)) << draw(st.integers(1, 5)), r),
        lambda: LatinHypercube((r := draw(replicates)) * draw(each), r),
        lambda: Saltelli(
            (r := draw(replicates)) << draw(st.integers(1, 4)), r, second_order=draw(st.booleans())
        ),
        lambda: Morris(draw(each), draw(st.sampled_from([4, 6]))),
        lambda: MonteCarlo(draw(st.integers(1, 50))),
    ]
    make = draw(st.sampled_from(kinds))
    return make(), make()


@settings(max_examples=20)
@given(pair=pairs_of_designs())
def test_what_is_kept_and_what_would_keep_all_is_reported(pair):
    check_extension(*pair)


def test_points_beyond_a_block_keep_those_before():
    check_extension(MonteCarlo(BLOCK + 5), MonteCarlo(BLOCK - 3))


def redrawn(design, share):
    """Return the points of all rounds of a design, a share of which are inadmissible."""
    joint = JOINTS["truncated"]

    def runs(points, number):
        is_lost = np.mod(10 * points["a"] * points["b"], 1) < share
        status = np.where(is_lost, Status.INADMISSIBLE, Status.OK)
        return {"": points.assign({STATUS: (RUN, status.astype(np.int8))})}

    rounds = run_rounds(design, joint, Stream(3, "designs", "mine"), runs)
    rows = [np.column_stack([each[""]["a"], each[""]["b"]]) for each in rounds]
    assert len(rounds) > 2, "some are drawn again twice"
    return Counter(row.tobytes() for row in np.concatenate(rows))


@settings(max_examples=5)
@given(
    replicates=st.tuples(st.integers(2, 4), st.integers(0, 3)),
    exponents=st.tuples(st.integers(2, 4), st.integers(0, 2)),
    is_second_order=st.tuples(st.booleans(), st.booleans()),
    share=st.sampled_from([0.3, 0.6]),
)
def test_a_larger_design_keeps_what_was_drawn_again(replicates, exponents, is_second_order, share):
    few, more = replicates
    size, doublings = exponents
    earlier = Saltelli(few << size, few, second_order=all(is_second_order))
    many = few + more
    new = Saltelli(many << (size + doublings), many, second_order=any(is_second_order))
    assert redrawn(earlier, share) <= redrawn(new, share)


@pytest.mark.parametrize(
    ("new", "earlier", "text"),
    [
        (
            LatinHypercube(300, 10),
            LatinHypercube(200, 10),
            "200 of its 200 earlier runs are not used; to use all of them: runs = 300, "
            "replicates = 15 (replicates of 20 points)",
        ),
        (
            SobolSequence(1024, 32),
            SobolSequence(1024, 16),
            "512 of its 1024 earlier runs are not used; to use all of them: runs = 2048, "
            "replicates = 32 (no fewer replicates than 16, of 64 points each)",
        ),
        (
            Saltelli(64, 8),
            Saltelli(32, 2, second_order=True),
            "128 of its 192 earlier runs are not used; to use all of them: base = 128, "
            "replicates = 8, second_order = true (no fewer replicates than 2, of 16 points each)",
        ),
        (
            Morris(20, 6),
            Morris(10),
            "30 of its 30 earlier runs are not used; to use all of them: trajectories = 20, "
            "levels = 4 (the same levels)",
        ),
        (
            LatinHypercube(40, 4),
            LatinHypercube(20, 2, "random-cd"),
            "20 of its 20 earlier runs are not used; to use all of them: runs = 40, "
            'replicates = 4, optimization = "random-cd" (replicates of 10 points)',
        ),
        (MonteCarlo(500), MonteCarlo(2000), "1500 of its 2000 earlier runs are not used"),
        (MonteCarlo(2000), MonteCarlo(500), ""),
        (MonteCarlo(until=Precision({"y": {"mean": 0.1}}), at_most=4096), MonteCarlo(4096), ""),
        (FullFactorial(7), FullFactorial(7), ""),
        (
            FullFactorial(8),
            FullFactorial(7),
            "it is not known how many of its 49 earlier runs it uses",
        ),
        (
            MonteCarlo(10),
            SobolSequence(64),
            "it is not known how many of its 64 earlier runs it uses",
        ),
    ],
    ids=str,
)
def test_a_loss_is_reported_with_the_nearest_that_has_none(new, earlier, text):
    joint = example_joint_distribution()
    found = new.extension(earlier, joint)
    assert found.text(earlier.run_count(joint), new.run_count(joint)) == text


def test_a_design_that_promises_too_much_breaks_the_contract():
    class Promising(MonteCarlo):
        def extension(self, earlier, joint):
            return Extension(earlier.run_count(joint))

    with pytest.raises(AssertionError, match="64 points are kept, found 0"):
        check_extension(Promising(64), SobolSequence(64))
