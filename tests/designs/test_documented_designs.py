"""The designs of the page on extensions: one draws by SALib, one stops by a rule of its own."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.core.errors import StudyError
from uqpen.core.streams import Stream
from uqpen.designs.stopping.precision import Precision
from uqpen.testing import check_design, check_stopping_rule, example_joint_distribution
from uqpen.verification.verify import verify

PAGE = (Path(__file__).parents[2] / "docs" / "extending" / "design.md").read_text(encoding="utf-8")
STUDY = study_text(
    "ishigami",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 0},
    designs={"one": {"kind": "my_stopping.py:Growing", "at_most": 20_000}},
)


def block(start, language="python"):
    (found,) = re.findall(rf"```{language}\n({start}.*?)```", PAGE, re.DOTALL)
    return str(found)


@pytest.fixture
def folder(tmp_path):
    for name in ("my_blocks.py", "my_salib.py", "my_stopping.py"):
        (tmp_path / name).write_text(block(f"# {name}"))
    return tmp_path


@pytest.fixture
def modules(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    names = ("my_blocks", "my_salib", "my_stopping")
    yield {name: importlib.import_module(name) for name in names}
    for name in names:
        sys.modules.pop(name, None)


class TestPointsByBlocks:
    def test_they_meet_the_contract_of_designs(self, modules):
        check_design(modules["my_blocks"].Antithetic(pairs=200))

    def test_pairs_are_mirror_images_across_a_border(self, modules):
        joint = example_joint_distribution()
        (points,) = modules["my_blocks"].Antithetic(pairs=20).rounds(joint, Stream(1))
        parts = [points.read(0, 7)["length"].values, points.read(7, 40)["length"].values]
        pairs = np.concatenate(parts).reshape(20, 2)
        assert pairs.sum(axis=1) == pytest.approx(np.full(20, 4.0))


class TestSalib:
    def test_its_sampler_meets_the_contract_of_designs(self, modules):
        check_design(modules["my_salib"].SalibLatin(points=100))

    def test_each_replicate_is_a_hypercube_of_its_own(self, modules):
        joint = example_joint_distribution()
        design = modules["my_salib"].SalibLatin(points=50, replicates=4)
        (points,) = design.rounds(joint, Stream(1, "designs", "one"))
        for entry in joint.random:
            below = entry.distribution.cdf(points[entry.variable.name].values).reshape(4, 50)
            strata = np.sort((below * 50).astype(int), axis=1)
            assert np.array_equal(strata, np.tile(np.arange(50), (4, 1)))
            assert len(np.unique(below)) == 200

    def test_its_analysis_stands_beside_the_others(self, folder):
        study = uqpen.parse_study(block("analyses = \\[.my_salib", "toml"), folder=folder)
        tree = uqpen.run(study)
        assert tree["runs/salib"].sizes["run"] == 2_000
        found = tree["statistics/salib/y"]
        indices = found["random_balance"].sel(bound="estimate")
        exact = {"x1": 0.314, "x2": 0.442, "x3": 0.0}
        for name, index in exact.items():
            assert float(indices.sel(input=name)) == pytest.approx(index, abs=0.05)
        _, lower, upper = found["mean"].values
        assert lower < 3.5 < upper
        assert upper - lower < 0.3

    @pytest.mark.processor
    def test_its_archive_is_verified(self, folder):
        text = block("analyses = \\[.my_salib", "toml").replace("points = 200", "points = 20")
        uqpen.write(uqpen.run(uqpen.parse_study(text, folder=folder)), folder / "a.nc")
        checks = {check.name: check.verdict.name for check in verify(folder / "a.nc")}
        assert checks["points"] == "UNCHECKED"
        checks = {check.name: check.verdict.name for check in verify(folder / "a.nc", trust=True)}
        assert set(checks.values()) == {"EQUAL"}


class TestStopping:
    def test_both_meet_their_contracts(self, modules):
        module = modules["my_stopping"]
        check_stopping_rule(module.Symmetric("y", tolerance=0.5))
        check_design(module.Growing(at_most=5_000))
        check_design(module.Growing(at_most=5_000, until=Precision({"y": {"mean": 0.05}})))

    def test_it_stops_by_its_own_rule(self, folder):
        tree = uqpen.run(uqpen.parse_study(STUDY, folder=folder))
        attributes = tree["runs/one"].attrs
        assert attributes["stopping_rule"] == (
            "until mean and median of y agree within 0.5; at most 20000 runs"
        )
        mean, quantile = (tree["statistics/one/y"][name] for name in ("mean", "quantile"))
        median = float(quantile.sel(probability=0.5, bound="estimate"))
        assert float(mean[2]) - 0.5 <= median <= float(mean[1]) + 0.5
        assert 512 <= tree["runs/one"].sizes["run"] < 20_000

    def test_it_takes_the_rule_of_a_study(self, folder):
        text = STUDY + "until = { y = { mean = 0.4 } }\n"
        tree = uqpen.run(uqpen.parse_study(text, folder=folder))
        _, lower, upper = tree["statistics/one/y"]["mean"].values
        assert (upper - lower) / 2 <= 0.4
        with pytest.raises(StudyError, match="an unknown output"):
            uqpen.parse_study(text.replace("{ y =", "{ z ="), folder=folder)
