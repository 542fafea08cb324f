"""An archive that is made again with other designs: the user is shown which runs are not kept."""

import pytest

import uqpen
from uqpen.checkpoints.make_archive import runs_not_kept
from uqpen.execution import Progress

HEAD = """\
seed = {seed}
[model]
use = "ishigami"
[inputs]
x1 = {{ uniform = {{ lower = -3, upper = 3 }} }}
x2 = {{ uniform = {{ lower = -3, upper = 3 }} }}
x3 = {{ uniform = {{ lower = -3, upper = {upper} }} }}
[constraints]
keep = ["x1 < 2"]
"""
MONTE_CARLO = '[designs.d]\nkind = "monte-carlo"\n'
HYPERCUBES = '[designs.d]\nkind = "latin-hypercube"\n'
FACTORIAL = '[designs.d]\nkind = "full-factorial"\n'
UNUSED = "earlier runs are not used"
BLOCKS = '[designs.d]\nkind = "saltelli"\nreplicates = 2\n'


class Information(Progress):
    """What a user is shown before anything runs."""

    def __init__(self):
        self.texts = []

    def inform(self, text):
        self.texts.append(text)


def parse(design, *, seed=1, upper=3):
    return uqpen.parse_study(HEAD.format(seed=seed, upper=upper) + design)


def reported(archive, study):
    return [f"{name}: {text}" for name, text in runs_not_kept(study, archive).items()]


@pytest.mark.parametrize(
    ("earlier", "now", "text"),
    [
        (f"{MONTE_CARLO}runs = 30", f"{MONTE_CARLO}runs = 40", ""),
        (f"{BLOCKS}base = 8", f"{BLOCKS}base = 16", ""),
        (f"{MONTE_CARLO}runs = 30", f"{MONTE_CARLO}runs = 10", f"20 of its 30 {UNUSED}"),
        (
            f"{HYPERCUBES}runs = 40",
            f"{HYPERCUBES}runs = 60",
            f"40 of its 40 {UNUSED}; to use all of them: runs = 60, replicates = 15 (replicates "
            "of 4 points)",
        ),
        (
            f"{HYPERCUBES}runs = 40",
            f"{MONTE_CARLO}runs = 60",
            f"its 40 {UNUSED}: it is of another kind",
        ),
        (
            f"{MONTE_CARLO}runs = 30",
            f"{MONTE_CARLO}runs = 30".replace("d]", "e]"),
            f"its 30 {UNUSED}: the study has no design of this name",
        ),
        (
            f"{FACTORIAL}levels = 2",
            f"{FACTORIAL}levels = 3",
            "it is not known how many of its 8 earlier runs it uses",
        ),
        (
            f"{MONTE_CARLO}until = {{ y = {{ mean = 9 }} }}\nat_most = 4096",
            f"{MONTE_CARLO}runs = 100",
            f"412 of its 512 {UNUSED}",
        ),
    ],
)
def test_runs_that_are_not_kept_are_reported(earlier, now, text):
    archive = uqpen.run(parse(earlier))
    assert reported(archive, parse(now)) == ([f"d: {text}"] if text else [])


@pytest.mark.parametrize("change", [{"seed": 2}, {"upper": 2}], ids=str)
def test_nothing_is_advised_where_all_points_are_others(change):
    archive = uqpen.run(parse(HYPERCUBES + "runs = 40"))
    assert reported(archive, parse(HYPERCUBES + "runs = 60", **change)) == []


def test_the_code_of_an_archive_is_not_executed(tmp_path):
    code = "from uqpen import MonteCarlo\nclass Mine(MonteCarlo): pass\n"
    (tmp_path / "mine.py").write_text(code, encoding="utf-8")
    earlier, now = (
        f'{HEAD.format(seed=1, upper=3)}[designs.d]\nkind = "mine.py:Mine"\nruns = {runs}'
        for runs in (20, 30)
    )
    archive = uqpen.run(uqpen.parse_study(earlier, folder=tmp_path))
    study = uqpen.parse_study(now, folder=tmp_path)
    (tmp_path / "mine.py").write_text("raise RuntimeError('executed')\n", encoding="utf-8")
    text = "d: it is not known how many of its 20 earlier runs it uses"
    assert reported(archive, study) == [text]


def test_it_is_reported_before_the_archive_is_replaced(tmp_path):
    progress, path = Information(), tmp_path / "study.nc"
    for runs in (40, 60):
        uqpen.make_archive(parse(f"{HYPERCUBES}runs = {runs}"), path, progress=progress)
    reported_of = [text for text in progress.texts if text.startswith("d: ")]
    assert [text[:40] for text in reported_of] == ["d: 40 of its 40 earlier runs are not use"]
    assert "d: 40 of its 40" in (tmp_path / "study.nc.log").read_text(encoding="utf-8")
