"""What people write in other programs is met with what it is here."""

import pytest
from study_text import study_text

import uqpen


def expected(tmp_path, **changes):
    """What a study is told to expect, of all its mistakes."""
    parts = {
        "inputs": {"x": "(2 ± 0.1) m", "y": "2 m"},
        "designs": {"d": {"kind": "monte-carlo", "runs": 50}},
        **changes,
    }
    (tmp_path / "m.py").write_text("def f(x, y):\n    return {'z': x * y}\n")
    model = {"python": "m.py:f", "inputs": {"x": "m", "y": "m"}, "outputs": {"z": "m2"}}
    with pytest.raises(uqpen.StudyError) as caught:
        uqpen.parse_study(study_text(model, seed=1, **parts), folder=tmp_path)
    return "\n".join(problem.expected for problem in caught.value.problems)


WORDS = {
    ("designs", "d", "kind"): {
        "lhs": "latin-hypercube",
        "random": "monte-carlo",
        "mc": "monte-carlo",
        "sobol": "sobol-sequence",
        "qmc": "sobol-sequence",
        "sobol_indices": "saltelli",
        "grid": "full-factorial",
        "OAT": "one-at-a-time",
        "mcmc": "posterior",
        "calibration": "posterior",
        "FORM": "form",
    },
    ("surrogates", "s", "kind"): {
        "kriging": "gaussian-process",
        "GP": "gaussian-process",
        "pce": "polynomial-chaos",
    },
    ("inputs", "x", "normal"): {"loc": "mean", "mu": "mean", "scale": "std", "sigma": "std"},
    ("inputs", "x", "uniform"): {"min": "lower", "max": "upper", "low": "lower"},
    ("inputs", "x"): {"gaussian": "normal", "norm": "normal"},
    ("designs", "d"): {"samples": "runs", "n": "runs", "size": "runs"},
    ("outputs", "z"): {"limit": "exceeds", "percentiles": "quantiles", "less_than": "below"},
    (): {"parameters": "inputs", "correlation": "dependence", "calibration": "measured"},
}
CASES = [(path, word, here) for path, words in WORDS.items() for word, here in words.items()]


@pytest.mark.parametrize(
    ("path", "word", "here"), CASES, ids=[".".join((*path, word)) for path, word, _ in CASES]
)
def test_a_word_of_other_programs_is_met_with_the_one_here(path, word, here, tmp_path):
    value = {"mean": "1 m"} if path in {("inputs", "x"), ()} else ["1 m2"]
    changes = {word: {"some": value} if path == () else value}
    if path[:1] == ("designs",):
        changes |= {"kind": "monte-carlo"}
    if path[2:] == ("kind",):
        path, changes = path[:2], {"kind": word, "design": "d"}
    for key in reversed(path):
        changes = {key: changes}
    assert f'did you mean "{here}"?' in expected(tmp_path, **changes)


@pytest.mark.parametrize(
    ("form", "here"),
    [
        ("2 +/- 0.1 m", '"(2 ± 0.1) m" if'),
        ("2 m to 3 m", '{ uniform = { lower = "2 m", upper = "3 m" } } if all values between'),
        ("2 m to 3 m", '{ interval = ["2 m", "3 m"] } if nothing but the ends is known'),
        ("50 % ± 5 %", '"(50 ± 5) %", or "(50 ± 2.5) %" if it is a share of the mean'),
        ("2 m ± 1 s", "a length, such as"),
        ("2 - 3 m", '{ uniform = { lower = "2 m", upper = "3 m" } }'),
        ("2..3 m", '{ uniform = { lower = "2 m", upper = "3 m" } }'),
        ("[2, 3] m", '{ uniform = { lower = "2 m", upper = "3 m" } }'),
        ("200 cm to 3 m", '{ uniform = { lower = "200 cm", upper = "3 m" } }'),
        (["2 m", "300 cm"], '{ interval = ["2 m", "300 cm"] } if nothing but the ends is known'),
        ([2, 3], "{ uniform = { lower = 2, upper = 3 } }"),
        ("N(2, 0.1) m", '"(2 ± 0.1) m"'),
        ("U(2, 3) m", '{ uniform = { lower = "2 m", upper = "3 m" } }'),
        ({"type": "normal", "mean": "2 m", "std": "1 m"}, "{ normal = { mean = …, std = … } }"),
        ({"type": "foo", "bar": 2}, "one distribution of normal, lognormal, uniform, "),
        ({"normal": {"mean": "2 m", "std": "1 m"}, "uper": "3 m"}, 'did you mean "upper"?'),
        ({"lower": "2 m", "upper": "3 m"}, "or { interval = [lower, upper] }"),
        ({"levy": {"scale": 2}}, '{ scipy = { name = "levy", … } }; or known: normal'),
        ({"kumaraswamy": {"a": 2}}, '{ chaospy = { name = "Kumaraswamy", … } }'),
        ("5 Ah", 'did you mean "A h"?'),
    ],
    ids=str,
)
def test_a_form_of_an_input_is_met_with_all_that_it_may_mean(form, here, tmp_path):
    assert here in expected(tmp_path, inputs={"x": form, "y": "2 m"})


@pytest.mark.parametrize(
    ("form", "std", "says"),
    [
        ("2 m ± 3 %", 0.06, ", where ± is one standard deviation, 0.06 m"),
        ("(2 ± 3 %) m", 0.06, ", where ± is one standard deviation, 0.06 m"),
        ("200 cm +/- 3%", 0.06, ", where ± is one standard deviation, 6 cm"),
        ("2 m ± 0.1 m", 0.1, ", where ± is one standard deviation, 0.1 m"),
        ("2 m +/- 5 cm", 0.05, ", where ± is one standard deviation, 0.05 m"),
        ("(2 ± 0.1) m", 0.1, ""),
    ],
)
def test_a_spread_is_one_standard_deviation_and_says_so(form, std, says, tmp_path):
    (tmp_path / "m.py").write_text("def f(x):\n    return {'z': x}\n")
    model = {"python": "m.py:f", "inputs": {"x": "m"}, "outputs": {"z": "m"}}
    designs = {"d": {"kind": "monte-carlo", "runs": 50}}
    text = study_text(model, seed=1, inputs={"x": form}, designs=designs)
    (entry,) = uqpen.parse_study(text, folder=tmp_path).joint.random
    assert entry.distribution.mean == pytest.approx(2.0)
    assert entry.distribution.std == pytest.approx(std)
    assert entry.description == f"normal {form}{says}"


def test_a_single_threshold_is_met_with_its_list(tmp_path):
    assert 'a list in square brackets: ["3 m2"]' in expected(
        tmp_path, outputs={"z": {"exceeds": "3 m2"}}
    )
