"""The main results: sentences with the archive's numbers, their design, their caveats."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
import xarray as xr

import uqpen
from uqpen.archive.read import read_group
from uqpen.report.blocks import Block, Quote, Remarks, Text
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_texts
from uqpen.study.study import ValidatedStudy

pytestmark = pytest.mark.slow

GENERAL = (
    "An interval on this page covers the sampling error alone. It contains neither the error of "
    "the model nor that of the assumed distributions of the inputs.",
    "The confidence level is that of each interval by itself; all of them together are right less "
    "often. No interval can include a tail that is missing in the runs.",
)

DESIGNS = {
    "morris": 'kind = "morris"\ntrajectories = 4',
    "quadrature": 'kind = "quadrature"\norder = 3',
    "saltelli": 'kind = "saltelli"\nbase = 64',
    "monte_carlo": 'kind = "monte-carlo"\nruns = 5',
}


def _texts(blocks: list[Block]) -> list[str]:
    """All sentences, with plain spaces."""
    found: list[str] = []
    for block in blocks:
        match block:
            case Quote(sentences):
                found += sentences
            case Text(text):
                found.append(text)
            case Remarks(head, lines):
                found += (head, *lines)
    return [text.replace("\u00a0", " ").replace("\u202f", " ") for text in found]


def _told(tree: xr.DataTree, model: str = "") -> list[str]:
    return _texts(list(answer(ArchiveView(tree, model))))


def test_every_sentence_stands_by_itself(archives: Mapping[str, xr.DataTree]) -> None:
    tree = archives["schema_2"]
    assert _told(tree) == [
        "With 95 % confidence, y is at most 11.5 in at least 80 % of all admissible cases. The "
        "best estimate of this limit is 5.9.",
        "The probability that y exceeds 10, given admissible inputs, is 5 % (0 % to 26 %, 95 % "
        "interval).",
        "The median of y is 3.6 (0.9 to 5.9, 95 % interval): half of all admissible cases have at "
        "most this value.",
        "These estimates are by monte_carlo, the first design of the study that is a sample of "
        "the inputs. Its place in the study decides, not its results. Of its 20 runs of the model "
        "ishigami 0.1.0, 19 completed.",
        "Estimates by other designs, from runs of their own (intervals are further down)",
        "y, limit for 80 % of cases: 5.5 to 7.2 by 2 other designs, 5.9 by monte_carlo.",
        "y, P(> 10): 0 % to 6 % by 2 other designs, 5 % by monte_carlo.",
        "y, median: 2.8 to 4.5 by 2 other designs, 3.6 by monte_carlo.",
        "What to keep in mind",
        "1 of the 20 points of monte_carlo was inadmissible, so outside of what the model or the "
        "study allows. The probability of this is 5 % (0 % to 25 %, 95 % interval). All estimates "
        "are conditional on admissible inputs.",
        *GENERAL,
    ]
    held = read_group(tree, "statistics", "monte_carlo", "y")["tolerance_limit"].values[0]
    assert (f"{held[0]:.1f}", f"{held[2]:.1f}") == ("5.9", "11.5")
    exceeded = read_group(tree, "statistics", "monte_carlo", "y")["exceedance"].values[0]
    assert [f"{100 * bound:.0f}" for bound in exceeded] == ["5", "0", "26"]


def test_lost_runs_and_notes_are_told(archives: Mapping[str, xr.DataTree]) -> None:
    said = _told(archives["beam"])
    assert said[:2] == [
        "The probability that deflection exceeds 2 mm is 100 % (73 % to 100 %, 95 % interval). "
        "The estimate leaves out 18.3 % of the admissible runs, which did not complete; the "
        "interval includes every result that they could have had.",
        # Nothing is claimed of cases in which there is no result.
        "The median of deflection is 3.66 mm (3.52 mm to 3.91 mm, 95 % interval): half of all "
        "cases in which the model gives a result have at most this value. This leaves out 18.3 % "
        "of the admissible runs, which did not complete.",
    ]
    assert said[3:] == [
        "What to keep in mind",
        "Deflection, P(> 2 mm): allows for any outcome of the missing runs (22).",
        "18.3 % of the admissible runs did not complete (22 failed). All estimates use the "
        "completed runs. If the others would have given different results, the estimates are "
        "biased.",
        *GENERAL,
    ]


def test_a_single_run_is_told_in_the_singular(study_of: Callable[..., ValidatedStudy]) -> None:
    text = '[designs.some]\nkind = "monte-carlo"\nruns = 1'
    told = _told(uqpen.run(study_of("a + b", text, a=(0.0, 1.0), b=(0.0, 2.0))))
    assert told[1].endswith(
        "Its place in the study decides, not its results. It is a single run of the model "
        "line.py:f."
    )


def test_where_no_run_came_back_there_is_no_answer(archives: Mapping[str, xr.DataTree]) -> None:
    (block,) = answer(ArchiveView(archives["lost"], ""))
    assert block == Text(
        "No run completed, so there are no estimates. All 120 runs failed. The reason: "
        "“ValueError: too heavy” (failed, 120 runs). Mend the model, raise its time limit, or "
        "change the inputs to values that it allows; then run the study again. The archive has "
        "the inputs of every failed run, so you can try a single one."
    )


def test_of_several_models_each_has_its_answer(archives: Mapping[str, xr.DataTree]) -> None:
    tree = archives["rods"]
    first, other = _told(tree, "original"), _told(tree, "rigid")
    assert "The probability that depth of penetration exceeds 60 cm is 11.0 % " in first[0]
    assert "The probability that depth of penetration exceeds 60 cm is 100.0 % " in other[0]
    assert any(text.startswith("How erosion ends: “v = u” in 63.0 % of all") for text in first)
    assert any(text.startswith("How erosion ends: “rigid” in 100.0 % of all") for text in other)
    # A note stands once, with all that it is of.
    assert (
        "How erosion ends, share of “rigid”, “v = u”, “u = 0”: conservative: the interval may be "
        "wider than it need be."
    ) in other
    # What holds for the whole page is said once.
    assert set(GENERAL) <= set(first)
    assert not set(GENERAL) & set(other)


@pytest.mark.parametrize(
    ("design", "said"),
    [
        (
            "morris",
            [
                "No design of this study is a sample of its inputs, so the distributions of the "
                "outputs and all probabilities are unknown. The results of its designs are "
                "further down."
            ],
        ),
        (
            "quadrature",
            [
                "By the integration rule some, the mean of y is 1.5 (without an interval: a "
                "quadrature rule has no scatter, so its error is unknown)."
            ],
        ),
        (
            "saltelli",
            [
                "These estimates are by some, a design for sensitivity indices; two of its "
                "matrices are a sample of the inputs, and no other sample of the study has a "
                "completed run."
            ],
        ),
        (
            "monte_carlo",
            [
                "In 99 % of all cases y is at most",
                "by estimate. This limit has no upper bound: an upper bound needs at least 299 "
                "runs.",
                "Further down: 1 more estimate of these outputs.",
            ],
        ),
    ],
)
def test_what_a_design_cannot_tell_is_said(
    study_of: Callable[..., ValidatedStudy], design: str, said: list[str]
) -> None:
    asked = '[outputs.y]\nhold = [0.99]\nexceeds = ["1", "2", "3"]'
    text = f"{asked}\n[designs.some]\n{DESIGNS[design]}"
    told = " ".join(_told(uqpen.run(study_of("a + b", text, a=(0.0, 1.0), b=(0.0, 2.0)))))
    for each in said:
        assert each in told


def test_only_some_of_many_outputs_have_sentences(tmp_path: Path) -> None:
    names = [f"y{number}" for number in range(8)]
    results = ", ".join(f'"{name}": x' for name in names)
    (tmp_path / "many.py").write_text(f"def f(x):\n    return {{{results}}}\n")
    outputs = "\n".join(f'{name} = "1"' for name in names)
    tree = uqpen.run(
        uqpen.parse_study(
            f'seed = 1\n[model]\npython = "many.py:f"\n[model.inputs]\nx = "1"\n'
            f"[model.outputs]\n{outputs}\n"
            "[inputs]\nx = { uniform = { lower = 0, upper = 1 } }\n"
            '[outputs.y7]\nexceeds = ["0.5"]\n'
            '[designs.some]\nkind = "monte-carlo"\nruns = 20',
            folder=tmp_path,
        )
    )
    told = _told(tree)
    # What was asked comes first.
    assert told[0].startswith("The probability that y7 exceeds 0.5 is ")
    assert sum(text.startswith("The median of ") for text in told) == 6
    assert "Further down: 2 more outputs." in told


@pytest.mark.parametrize(
    ("bounds", "texts"),
    [
        ((0.49274, 0.49004, 0.49544, 0.5), ("0.4927", "0.4900", "0.4954", "0.5000")),
        ((0.0, 0.0, 0.0369), ("0", "0", "0.037")),
        ((3.51234567, float("nan"), float("nan")), ("3.512", "–", "–")),
        ((1.234e-7, 1.134e-7, 1.334e-7), ("1.23×10⁻⁷", "1.13×10⁻⁷", "1.33×10⁻⁷")),
    ],
)
def test_figures_in_a_sentence_have_sensible_digits(
    bounds: tuple[float, ...], texts: tuple[str, ...]
) -> None:
    assert estimate_texts(*bounds) == texts
