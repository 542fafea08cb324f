"""A black-box challenge: a hidden model behind a budget of runs that no client can exceed."""

import contextlib
import json
import signal
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import umbridge
from model_servers import asked, offering, serving
from study_text import study_text

import uqpen
from uqpen.cli.serve import hidden_offers, make_offers
from uqpen.core.errors import ModelError
from uqpen.server import RunBudget

pytestmark = pytest.mark.slow

FUNCTION = """
import math

def sum_of_roots(strength, span):
    if strength < 2.0:
        raise RuntimeError(f"no equilibrium at strength {strength}")
    return {"load": math.sqrt(strength) + span}
"""
STUDY = study_text(
    {
        "python": "model.py:sum_of_roots",
        "inputs": {"strength": "Pa", "span": "m"},
        "outputs": {"load": "N"},
    },
    inputs={"strength": {"lognormal": {"mean": "4 Pa", "std": "0.5 Pa"}}, "span": "(3 ± 0.5) m"},
    designs={"some": {"kind": "monte-carlo", "runs": 10}},
)


@pytest.fixture
def study(tmp_path):
    (tmp_path / "model.py").write_text(FUNCTION)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path / "study.toml"


@contextlib.contextmanager
def challenge(study, runs):
    """The address of a server of a hidden model with a budget."""
    offers = hidden_offers(str(study), make_offers(str(study)))
    count = study.with_name("count.jsonl")
    with (
        RunBudget(count, runs, {"model": {"version": 1}}) as budget,
        offering(*offers, budget=budget) as address,
    ):
        yield address


def ask(address, path, **request):
    """Code and content of the answer to a request for the model."""
    return asked(address, path, json.dumps({"name": "model", **request}).encode())


def test_standard_normal_numbers_become_the_inputs(study):
    with challenge(study, 10) as address:
        model = umbridge.HTTPModel(address, "model")
        assert model.get_input_sizes() == [2]
        ((load,),) = model([[0.0, 2.0]])
    # The median of the lognormal distribution is its mean over √(1 + (std/mean)²).
    median = 4 / np.sqrt(1 + 0.125**2)
    assert load == pytest.approx(np.sqrt(median) + 4.0, rel=1e-9)  # of the inverse of ndtr


def test_the_budget_is_spent_by_runs_whether_they_fail_or_not(study):
    with challenge(study, 3) as address:
        assert ask(address, "Evaluate", input=[[0.0, 0.0]])[0] == 200
        assert ask(address, "Evaluate", input=[[-9.0, 0.0]])[0] == 500
        assert ask(address, "ModelInfo")[1]["runsLeft"] == 1
        assert ask(address, "Evaluate", input=[[0.0]])[0] == 400  # no run was asked for
        assert ask(address, "Evaluate", input=[[float("nan"), 0.0]])[0] == 400
        assert ask(address, "Evaluate", input=[[0.0, float("-inf")]])[0] == 400
        assert ask(address, "ModelInfo")[1]["runsLeft"] == 1
        assert ask(address, "Evaluate", input=[[0.0, 0.0]])[0] == 200
        code, answer = ask(address, "Evaluate", input=[[0.0, 0.0]])
        assert code == 403
        assert answer["error"] == {
            "type": "BudgetSpent",
            "message": "all 3 runs of model have been made",
        }
        assert ask(address, "ModelInfo")[1]["runsLeft"] == 0


def test_nothing_that_a_client_sees_names_an_input(study):
    with challenge(study, 10) as address:
        answers = [
            ask(address, "ModelInfo"),
            ask(address, "InputSizes"),
            ask(address, "Evaluate", input=[[-9.0, 0.0]]),
            ask(address, "Evaluate", input=[[0.0]]),
            ask(address, "Evaluate", input=[[0.0, 0.0]], config={"a": 1}),
        ]
    assert answers[2] == (500, {"error": {"type": "Failed", "message": "the run has no result"}})
    for word in ("strength", "span", "sum_of_roots", "equilibrium", "Pa"):
        assert word not in json.dumps(answers)


def test_the_count_goes_on_with_the_next_server(study):
    with challenge(study, 3) as address:
        ask(address, "Evaluate", input=[[0.0, 0.0]])
        ask(address, "Evaluate", input=[[0.0, 1.0]])
    with challenge(study, 3) as address:
        assert ask(address, "ModelInfo")[1]["runsLeft"] == 1
        assert ask(address, "Evaluate", input=[[0.0, 0.0]])[0] == 200
        assert ask(address, "Evaluate", input=[[0.0, 0.0]])[0] == 403
    with challenge(study, 4) as address:  # who offers it may raise the budget
        assert ask(address, "ModelInfo")[1]["runsLeft"] == 1
    lines = (study.parent / "count.jsonl").read_text().splitlines()
    assert [json.loads(line).get("input") for line in lines] == [
        None,
        [0.0, 0.0],
        [0.0, 1.0],
        [0.0, 0.0],
    ]


def test_clients_at_once_cannot_spend_more(study):
    with challenge(study, 20) as address, ThreadPoolExecutor(8) as pool:
        codes = pool.map(lambda _: ask(address, "Evaluate", input=[[0.0, 0.0]])[0], range(60))
        assert sorted(codes) == [200] * 20 + [403] * 40


class TestCount:
    def test_a_line_of_a_killed_server_grants_nothing(self, tmp_path):
        path = tmp_path / "count.jsonl"
        with RunBudget(path, 5, {"a": {"version": 1}}) as budget:
            budget.grant("a", [1.0])
        path.write_bytes(path.read_bytes() + b'{"model": "a", "inp')
        with RunBudget(path, 5, {"a": {"version": 1}}) as budget:
            assert budget.left("a") == 4
            budget.grant("a", [2.0])
        with RunBudget(path, 5, {"a": {"version": 1}}) as budget:
            assert budget.left("a") == 3

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            (b"not JSON\n", "is no count of runs of a server"),
            (b"[]\n", "is no count of runs of a server"),
            (b'{"models": {"a": "v2"}}\n', "counts the runs of other models, or of another"),
        ],
    )
    def test_another_file_is_refused(self, tmp_path, content, message):
        path = tmp_path / "count.jsonl"
        path.write_bytes(content)
        with pytest.raises(ModelError, match=message):
            RunBudget(path, 5, {"a": {"version": 1}})
        assert path.read_bytes() == content

    @pytest.mark.parametrize(
        ("old", "new"),
        [
            ('load = "N"', 'load = "kN"'),
            ('span = "m"', 'span = "mm"'),
            ("[designs.some]", "[constraints]\nkeep = [\"span > '1 m'\"]\n[designs.some]"),
            ("± 0.5) m", "± 0.6) m"),
        ],
    )
    def test_it_is_of_one_version_of_the_study(self, study, old, new):
        def identities():
            offers = hidden_offers(str(study), make_offers(str(study)))
            return {offer.name: offer.identity for offer in offers}

        path = study.with_name("count.jsonl")
        with RunBudget(path, 5, identities()) as budget:
            budget.grant("model", [1.0, 1.0])
        with RunBudget(path, 5, identities()) as budget:
            assert budget.left("model") == 4
        assert old in STUDY
        study.write_text(STUDY.replace(old, new))
        with pytest.raises(ModelError, match="counts the runs of other models, or of another"):
            RunBudget(path, 5, identities())

    @pytest.mark.skipif(sys.platform == "win32", reason="files are not locked there")
    def test_two_servers_cannot_count_in_one_file(self, tmp_path):
        with (
            RunBudget(tmp_path / "count.jsonl", 5, {"a": {"version": 1}}),
            pytest.raises(ModelError, match="another server counts its runs in this file"),
        ):
            RunBudget(tmp_path / "count.jsonl", 5, {"a": {"version": 1}})


def test_the_command_counts_across_a_kill(study):
    arguments = ("study.toml", "--budget", "2", "--hidden")
    with serving(study.parent, *arguments) as (said, address, process):
        assert 'hidden: clients know "model", a vector of 2 standard normal numbers' in said
        assert "model: 2 of 2 runs left, counted in archives/study.count.jsonl" in said
        assert ask(address, "Evaluate", input=[[0.0, 0.0]])[0] == 200
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=60)
    with serving(study.parent, *arguments) as (said, address, _):
        assert "model: 1 of 2 runs left" in said
        assert ask(address, "Evaluate", input=[[0.0, 0.0]])[0] == 200
        assert ask(address, "Evaluate", input=[[0.0, 0.0]])[0] == 403
        # A budget that is spent is seen by a study as failed runs, and by its reason.
        text = STUDY.partition("[model]")[0] + f'[model]\numbridge = "{address}"\n'
        text += 'inputs = { a = "1", b = "1" }\noutputs = { y = "1" }\n'
        text += '[inputs]\na = "0 ± 1"\nb = "0 ± 1"\n'
        text += '[designs.some]\nkind = "monte-carlo"\nruns = 5\n'
        runs = uqpen.run(uqpen.parse_study(text))["runs/some"]
    assert set(runs["lost_reason"].values) == {"BudgetSpent: all 2 runs of model have been made"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ishigami", "--count", "a"], "--count is the file of a --budget"),
        (["ishigami", "--hidden"], "ishigami: only models of a study can be hidden"),
        (["ishigami", "--hidden", "--inputs", "x1"], "--inputs are the model's own"),
        (["ishigami", "--budget", "0"], "Invalid value for '--budget'"),
        (["ishigami", "--budget", "5", "--count", "."], "runs cannot be counted there"),
    ],
)
def test_mistakes(command_line, arguments, message):
    done = command_line("serve", *arguments)
    assert done.code == 2
    assert message in done.err
