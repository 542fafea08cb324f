"""``[surrogates.<name>]`` becomes settings, or messages that say what to write instead."""

import pytest

from uqpen.core.errors import StudyError
from uqpen.study.load import parse_study
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos

STUDY = """\
seed = 1
[model]
use = "rigid-penetration"
[inputs]
projectile_density = "17.5 g/cm^3"
projectile_length = "16 cm"
impact_velocity = "1400 m/s"
projectile_yield_limit = "1.65 GPa"
projectile_sound_speed = "3071 m/s"
target_density = "(2.5 ± 0.05) g/cm^3"
target_yield_limit = "(400 ± 40) MPa"
plasticity_radius = "100 mm"
crater_radius = "17 mm"

[designs.training]
kind = "latin-hypercube"
runs = 200
[designs.fresh]
kind = "monte-carlo"
runs = 50
[designs.nodes]
kind = "quadrature"
order = 3
"""


def surrogate(text, name="pce"):
    return f'{STUDY}\n[surrogates.{name}]\nkind = "polynomial-chaos"\n{text}\n'


def report(text):
    """The report on one line: where, what was found and what is expected."""
    with pytest.raises(StudyError) as caught:
        parse_study(text)
    return " ".join(str(caught.value).split())


def test_a_surrogate_is_understood():
    text = """
design = "training"
check = "fresh"
order = 5
truncation = 0.75
method = "least-squares"
transform = { penetration_depth = "log" }
"""
    assert parse_study(surrogate(text)).surrogates == {
        "pce": PolynomialChaos(
            design="training",
            check="fresh",
            order=5,
            truncation=0.75,
            method="least-squares",
            transform={"penetration_depth": "log"},
        )
    }


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["surrogates.pce.design found nothing expected a name in quotes"]),
        (
            'design = "trainign"',
            [
                'surrogates.pce.design found "trainign"',
                'did you mean "training"? known: training, fresh, nodes',
            ],
        ),
        ('design = "training"\ncheck = "frsh"',
         ['surrogates.pce.check found "frsh"', 'did you mean "fresh"?']),
        ('design = "training"\ncheck = "training"',
         ["surrogates.pce.check found the design that it is fitted to"]),
        ('design = "training"\ncheck = "nodes"',
         ['found "nodes", which makes the nodes of an integration rule']),
        ('design = "training"\norder = 0', ["found 0 expected a whole number, at least 1 and at"]),
        ('design = "training"\norder = 51', ["at least 1 and at most 50"]),
        ('design = "training"\ntruncation = 1.5', ["a number above 0 and at most 1"]),
        ('design = "training"\ntruncation = 0', ["a number above 0 and at most 1"]),
        ('design = "training"\nmethod = "lars"',
         ['one of "sparse", "least-squares", "projection"']),
        ('design = "training"\nmethod = "projection"',
         ['found "training", which makes a sample expected a design of kind quadrature']),
        (
            'design = "training"\ntransform = { penetration_dept = "log" }',
            [
                "surrogates.pce.transform.penetration_dept found no such output",
                'did you mean "penetration_depth"?',
            ],
        ),
        ('design = "training"\ntransform = { termination = "log" }',
         ["an output of rigid-penetration that has numbers"]),
        (
            'design = "training"\ntransform = { penetration_depth = "square" }',
            [
                "surrogates.pce.transform.penetration_depth",
                'found "square" expected a table of names, each with one of "log"',
            ],
        ),
        ('design = "training"\ntransform = "log"', ["a table of names"]),
        ('design = "training"\nordr = 3', ["found an unknown key", 'did you mean "order"?']),
    ],
)  # fmt: skip
def test_mistakes_are_reported(text, parts):
    reported = report(surrogate(text))
    for part in parts:
        assert part in reported


def test_designs_and_surrogates_share_their_names():
    reported = report(surrogate('design = "training"', name="fresh"))
    assert 'found "fresh", which is a design expected a name that no design has' in reported
    assert "a name of letters, digits and _" in report(surrogate('design = "x"', name='"a-b"'))


def test_the_kind_must_be_known():
    text = surrogate('design = "training"')
    assert "expected one of polynomial-chaos" in report(
        text.replace('kind = "polynomial-chaos"', "")
    )
    reported = report(text.replace('"polynomial-chaos"', '"polynomial"'))
    assert 'did you mean "polynomial-chaos"?' in reported


def test_a_mistake_in_a_design_is_not_reported_twice():
    reported = report(surrogate('design = "training"').replace("runs = 200", "runs = 0"))
    assert "surrogates" not in reported


def test_a_quadrature_serves_every_method():
    for method in ("sparse", "least-squares", "projection"):
        text = surrogate(f'design = "nodes"\nmethod = "{method}"\ncheck = "fresh"')
        assert parse_study(text).surrogates["pce"].design == "nodes"


def test_designs_of_moves_are_refused():
    text = surrogate('design = "steps"') + '[designs.steps]\nkind = "one-at-a-time"\n'
    reported = report(text)
    assert "which makes steps from the nominal point expected a design that samples" in reported
