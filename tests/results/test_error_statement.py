"""Parts of the error of an answer: a finer model, alternatives, failed runs, and the total."""

import math

import numpy as np
import pytest
from scipy.stats import beta, norm

import uqpen
from uqpen.core.errors import StudyError
from uqpen.report.sections.answer import answer
from uqpen.report.sections.summary import summary_lines
from uqpen.results.archive_view import select_view
from uqpen.results.error_statement import ErrorPart, ErrorStatement, error_statements
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.statistics.model_form import quantile_difference, std_difference
from uqpen.statistics.run_samples import sample_of
from uqpen.study.identity import run_fingerprint

TABLE = '{head}\npython = "models.py:{name}"\nvectorized = true\ninputs = {{ x = "1", b = "1" }}\n'
STUDY = """seed = 5
{models}
[inputs]
x = "0 ± 1"
b = "0 ± 1"
[outputs.y]
exceeds = [1, 90]
[designs.some]
kind = "monte-carlo"
runs = 2000
{text}"""


def study_of_models(folder, text="", keys=None, **lines):
    """A study of models, each a line of NumPy in x and b, with further keys by name."""
    source, models = "import numpy as np\n", ""
    for name, line in lines.items():
        source += f"def {name}(x, b):\n    return {{'y': {line}}}\n"
        head = f"[models.{name}]" if len(lines) > 1 else "[model]"
        models += TABLE.format(head=head, name=name) + 'outputs = { y = "1" }\n'
        models += (keys or {}).get(name, "") + "\n"
    (folder / "models.py").write_text(source)
    return uqpen.parse_study(STUDY.format(models=models, text=text), folder=folder)


def statements(tree):
    return {each.label: each for each in error_statements(tree)}


def parts(statement):
    return {each.name: each for each in (*statement.parts, statement.total, *statement.bought)}


@pytest.fixture(scope="module")
def finer(tmp_path_factory):
    """The archive of x + b, and of the same on a finer grid, which shifts it by 1/4."""
    folder = tmp_path_factory.mktemp("finer")
    keys = {"fine": 'finer_than = "coarse"'}
    return uqpen.run(study_of_models(folder, keys=keys, coarse="x + b", fine="x + b + 0.25"))


def test_a_finer_model_is_a_part_by_its_paired_difference(finer):
    found = statements(finer)
    assert [*found] == [
        *("P(> 1)", "P(> 90)", "mean", "sd", "5 % quantile", "median", "95 % quantile")
    ]
    for label, of_finer in {"mean": 0.25, "sd": 0.0}.items():
        # Each run is shifted by the same, so the difference has no error.
        part = parts(found[label])["finer: fine"]
        assert part.lower == pytest.approx(found[label].answer)
        assert part.upper == pytest.approx(found[label].answer + of_finer)
    for label in ("5 % quantile", "median", "95 % quantile"):
        part = parts(found[label])["finer: fine"]
        assert part.lower <= found[label].answer < found[label].answer + 0.25 <= part.upper
        assert part.upper - part.lower < 0.4
    probability = found["P(> 1)"]
    part, y = parts(probability)["finer: fine"], finer["models/coarse/runs/some"]["y"].values
    changed = int(((y > 0.75) & (y <= 1)).sum())
    assert part.lower == probability.answer == np.mean(y > 1)
    # Clopper and Pearson's end of those that come, as none goes.
    upper = beta.ppf(0.975, changed + 1, 2000 - changed)
    assert part.upper == pytest.approx(probability.answer + upper, abs=1e-3)


def test_no_change_of_an_event_bounds_its_probability_all_the_same(finer):
    part = parts(statements(finer)["P(> 90)"])["finer: fine"]
    # 1 − 0.025^(1/n), as of none of n runs.
    assert (part.lower, part.upper) == (0.0, pytest.approx(-math.log(0.025) / 2000, rel=1e-3))


def test_the_total_is_computed_for_both_models_and_no_narrower_than_a_part(finer):
    fine = finer["models/fine/statistics/some/y"]
    for label, statement in statements(finer).items():
        total = statement.total
        for part in statement.parts:
            assert total.lower <= part.lower <= part.upper <= total.upper, (label, part.name)
        if label == "mean":
            assert total.upper == fine["mean"].values[2]
            added = sum(each.upper - statement.answer for each in statement.parts)
            assert total.upper - statement.answer < added
        assert total.definition == "computed for the runs, and over the same by finer fine"


def test_a_finer_model_over_a_box_is_in_the_total_without_a_paired_difference(tmp_path):
    keys = {"fine": 'finer_than = "coarse"'}
    study = study_of_models(tmp_path, keys=keys, coarse="x + b", fine="x + b + 0.25")
    box = study.text.replace('x = "0 ± 1"', "x = { normal = { mean = [0, 1], std = 1 } }")
    tree = uqpen.run(uqpen.parse_study(box, folder=tmp_path))
    mean = statements(tree)["mean"]
    own = parts(mean)
    coarse, fine = (tree[f"models/{name}/statistics/some/y"] for name in ("coarse", "fine"))
    # From the least mean of the one to the largest of the other, and their outer limits.
    ends = float(coarse["lower_mean"][0]), float(fine["upper_mean"][0])
    assert own["finer: fine"][1:3] == ends == pytest.approx((0, 1.25), abs=0.1)
    assert mean.total[1:3] == (float(coarse["lower_mean"][1]), float(fine["upper_mean"][2]))
    for name in ("coarse", "fine"):
        head = f"{name}: P(> 1) of y: By some: from "
        assert any(line.startswith(head) for line in summary_lines(tree))


def test_the_total_says_where_a_finer_model_has_no_interval(tmp_path):
    # Runs whose values the finer model spreads far have failed in the other, so no pair has them.
    lines = {"coarse": "np.where(x > 1.5, np.nan, x + b)"}
    lines["fine"] = "x + b + np.where(x > 1.5, np.exp(4 * x), 0)"
    keys = {"fine": 'finer_than = "coarse"'}
    found = statements(uqpen.run(study_of_models(tmp_path, keys=keys, **lines)))
    assert (
        found["sd"].total.definition == "computed for the runs; without an interval by finer fine"
    )
    expected = "computed for the runs, and over the same by finer fine"
    assert found["median"].total.definition == expected


def test_the_same_model_is_no_alternative(finer):
    assert "model_form" not in finer.children
    assert "model form" not in parts(statements(finer)["mean"])
    assert finer["models/fine"].attrs["finer_than"] == "coarse"


def test_a_statement_stands_in_tables_json_and_on_the_page(finer):
    (table,) = (each for each in output_tables(finer) if "what the errors are made" in each.title)
    assert [label for label, _ in table.rows] == [
        *("sampling", "finer: fine", "total", "sampling, 4 times the runs")
    ]
    stated = archive_json(finer)["errors"]["y, mean"]
    assert stated["finer: fine"]["upper"] == statements(finer)["mean"].parts[1].upper
    shown = [
        each.table
        for each in answer(select_view(finer, None, None, None))
        if hasattr(each, "table")
    ]
    assert table.title in [each.title for each in shown]


def test_to_call_a_model_finer_changes_none_of_its_runs(tmp_path):
    keys = {"fine": 'finer_than = "coarse"'}
    lines = {"coarse": "x + b", "fine": "x + b + 0.25"}
    with_key, without = (study_of_models(tmp_path, keys=each, **lines) for each in (keys, {}))
    assert run_fingerprint(with_key, "fine", "some") == run_fingerprint(without, "fine", "some")


@pytest.mark.parametrize(
    ("keys", "line", "found", "expected"),
    [
        ({"fine": "finer_than = 2"}, 13, "2", "the name of the first model"),
        ({"fine": 'finer_than = "coarser"'}, 13, '"coarser"', '"coarse" in another model'),
        ({"coarse": 'finer_than = "coarse"'}, 7, '"coarse"', "compared with the first one"),
        (
            {"fine": 'finer_than = "coarse"\nstands_for = "coarse"\ncost = 0.5'},
            13,
            "finer_than beside stands_for",
            "a finer model is no cheap one",
        ),
    ],
)
def test_a_wrong_finer_model_is_told_with_its_place(tmp_path, keys, line, found, expected):
    with pytest.raises(StudyError) as caught:
        study_of_models(tmp_path, keys=keys, coarse="x + b", fine="x + b + 0.25")
    told = str(caught.value)
    (name,) = keys
    assert f"study.toml:{line}  models.{name}.finer_than\n" in told
    assert found in told
    assert expected in told


def test_a_single_model_is_finer_than_none(tmp_path):
    with pytest.raises(StudyError, match=r"model\.finer_than\n.*unknown key"):
        study_of_models(tmp_path, keys={"one": 'finer_than = "one"'}, one="x + b")


def differences(slope, seed, size=400):
    """Differences of slope times x from x, x standard normal, of all that is estimated in pairs."""
    x = np.random.default_rng(seed).standard_normal(size)
    runs = uqpen_runs(x)
    first, other = sample_of(runs, "y"), sample_of(runs.assign(y=slope * runs["y"]), "y")
    return std_difference(first, other), quantile_difference(first, other, 0.9)


def uqpen_runs(values):
    import xarray as xr

    from uqpen.core.labels import STATUS
    from uqpen.core.sampling import Sampling

    run = np.zeros(len(values), np.int8)
    runs = xr.Dataset({"y": ("run", values), STATUS: ("run", run)})
    return runs.assign_attrs(sampling=str(Sampling.INDEPENDENT))


def test_differences_of_spread_and_quantile_contain_the_true_ones():
    exact, held = (0.1, 0.1 * norm.ppf(0.9)), np.zeros(2)
    for seed in range(100):
        for place, found in enumerate(differences(1.1, seed)):
            held[place] += found.lower <= exact[place] <= found.upper
    # 95 of 100, less three standard deviations of such a count.
    assert (held >= 88).all()
    std, quantile = differences(1.1, 1)
    # Unpaired, they would be 0.2 and 0.5 wide.
    assert std.upper - std.lower < 0.03
    assert quantile.upper - quantile.lower < 0.2


def test_alternatives_are_a_part_that_no_total_has(tmp_path):
    found = statements(uqpen.run(study_of_models(tmp_path, one="x + b", two="x + b + 3")))
    mean = parts(found["mean"])
    assert mean["model form"].upper - mean["model form"].lower == pytest.approx(3)
    assert mean["total"][1:3] == mean["sampling"][1:3]
    assert mean["total"].definition == "computed for the runs; without model form"


def test_a_stand_in_is_no_alternative(tmp_path):
    keys = {"two": 'stands_for = "one"\ncost = 0.1'}
    tree = uqpen.run(study_of_models(tmp_path, keys=keys, one="x + b", two="x + b + 3"))
    assert not statements(tree)


def test_failed_runs_are_a_part_of_a_probability(tmp_path):
    body = "np.where((x > -1) & (x < -0.9), np.nan, x + b)"
    tree = uqpen.run(study_of_models(tmp_path, one=body))
    found = statements(tree)
    # Nothing bounds the values of runs that failed, so there is no part of a mean.
    assert [*found] == ["P(> 1)", "P(> 90)"]
    one, runs = found["P(> 1)"], tree["runs/some"].to_dataset()
    lost, above = int(runs["y"].isnull().sum()), int((runs["y"] > 1).sum())
    own = parts(one)
    assert own["failed runs"][1:3] == pytest.approx((above / 2000, (above + lost) / 2000))
    assert own["total"][1:3] == own["sampling"][1:3]
    more = own["sampling, 4 times the runs"]
    # As large a share fails of more runs.
    assert more.lower == pytest.approx((own["failed runs"].lower + own["sampling"].lower) / 2)
    assert more.upper == pytest.approx((own["failed runs"].upper + own["sampling"].upper) / 2)


def test_a_total_has_the_digits_of_the_widest_part_whose_end_it_may_have():
    sampling, total = ErrorPart("sampling", 0.036, 0.152, ""), ErrorPart("total", 0.036, 0.19, "")
    form = ErrorPart("model form", 0.05, 0.9, "")
    statement = ErrorStatement("y", "P(> 1)", "some", "1", True, 0.06, (sampling, form), total, ())
    assert statement.text(sampling) == "3.6 % … 15.2 %"
    assert statement.text(total) == "3.6 % … 19.0 %"
    assert statement.text(form) == "5 % … 90 %"
    lengths = statement._replace(unit="mm", is_probability=False)
    assert lengths.text(total) == "36 … 190"
    alone = statement._replace(parts=(form,))
    assert alone.text(total) == "4 % … 19 %"


def test_one_part_alone_has_no_statement(tmp_path):
    tree = uqpen.run(study_of_models(tmp_path, one="x + b"))
    assert not statements(tree)
    assert "errors" not in archive_json(tree)


def test_a_surrogate_that_runs_correct_is_a_part(tmp_path):
    text = '[surrogates.chaos]\nkind = "polynomial-chaos"\ndesign = "some"\norder = 3\n'
    found = statements(uqpen.run(study_of_models(tmp_path, text, one="np.exp(x) + b")))
    part = parts(found["P(> 1)"])
    assert part["total"].lower <= part["surrogate chaos"].lower
    assert part["surrogate chaos"].upper <= part["total"].upper
    assert part["total"].definition.endswith("over the same by surrogate chaos")
