"""Archives that were made on other processors, which switches of the libraries stand in for."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest
from study_text import study_text

import uqpen
from uqpen.archive.provenance import provenance, provenance_differences
from uqpen.verification.diff import diff_archives

pytestmark = pytest.mark.slow

SWITCHES = {
    "as it is": {"OPENBLAS_NUM_THREADS": "2"},  # no bit depends on how many
    "another": {
        "OPENBLAS_CORETYPE": "Nehalem",
        "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL "
        "AVX512_ICL AVX2 FMA3",
    },
}

# Where an archive is made and where it is verified.
PAIRS = [("as it is", "as it is"), ("as it is", "another"), ("another", "as it is")]

# The sine is NumPy's own on each processor, and the fit is made by BLAS; a rule's mean is 0 but for
# rounding.
RUNS = "sensitivity = false\nconvergence = false\n" + study_text(
    "ishigami",
    title="Small",
    inputs={"x1": (-3, 3), "x2": {"lognormal": {"mean": 1, "std": 0.3}}, "x3": "0 ± 1"},
    designs={
        "sample": {"kind": "monte-carlo", "runs": 40},
        "rule": {"kind": "quadrature", "order": 2},
    },
)
# Most of the time that it takes to verify an archive: one whose runs are changed has none.
STUDY = f"""\
{RUNS}
[surrogates.chaos]
kind = "polynomial-chaos"
design = "sample"
order = 2
"""


class Made(NamedTuple):
    """Archives made under each switch, one of them changed, and what `verify` says of all."""

    folder: Path
    verified: dict[str, dict[str, tuple[int, str]]]

    def attributes(self, name):
        return uqpen.open_archive(self.folder / f"{name}.nc").attrs


@pytest.fixture(scope="module")
def made(tmp_path_factory, fresh_process):
    """Archives in a folder, verified under each switch, in one process for each."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "small.toml").write_text(STUDY)
    uqpen.write(uqpen.run(uqpen.load_study(folder / "small.toml")), folder / "as it is.nc")
    tree = uqpen.run(uqpen.parse_study(RUNS))
    # Above what another processor may change; a last bit is reported where nothing else differs.
    tree["runs/sample"]["y"].values[17] *= 1 + 1e-7
    uqpen.write(tree, folder / "forged.nc")
    verified = {}
    for here in reversed(SWITCHES):  # The last one verifies what those before it have made.
        is_there = (folder / f"{here}.nc").exists()
        makes = [] if is_there else [["study", "small.toml", "-o", f"{here}.nc"]]
        names = [*(there for there, other in PAIRS if other == here), "forged"]
        lines = [["verify", f"{name}.nc", "--all"] for name in names]
        outcomes = fresh_process(folder, *makes, *lines, variables=SWITCHES[here])
        assert all(done.code == 0 for done in outcomes[: len(makes)]), outcomes
        reported = [(done.code, done.said) for done in outcomes[len(makes) :]]
        verified[here] = dict(zip(names, reported, strict=True))
    return Made(folder, verified)


@pytest.mark.parametrize(("there", "here"), PAIRS)
def test_an_honest_archive_is_verified_on_another_processor(made, there, here):
    code, said = made.verified[here][there]
    assert code == 0, said
    differences = list(provenance_differences(made.attributes(there), made.attributes(here)))
    for name, then, now in differences:
        assert f"{name} {then} (here {now})" in said
    if not differences:
        assert "made with the same versions and kind of processor as here" in said
        assert said.count("bit-equal") == 2


@pytest.mark.parametrize("switch", SWITCHES)
def test_a_run_that_is_changed_and_hashed_anew_is_reported_everywhere(made, switch):
    code, said = made.verified[switch]["forged"]
    assert code == 4
    assert "sample: y of run 17 is" in said


def differences(**changed):
    here = provenance()
    return provenance_differences({**here, **changed}, here)


def test_only_features_that_differ_are_named():
    features = provenance()["cpu_features"].split()
    name, then, now = next(differences(cpu_features=" ".join([*features[1:], "NEON_9"])))
    assert (name, then, now) == ("cpu features", "NEON_9", features[0])


def test_an_archive_of_before_features_were_recorded_says_so():
    here = provenance()
    earlier = {name: value for name, value in here.items() if name != "blas"}
    assert list(provenance_differences(earlier, here)) == [("blas", "not recorded", here["blas"])]


def test_two_processors_are_distinguished_from_two_results(made):
    one, other = (uqpen.open_archive(made.folder / f"{each}.nc") for each in SWITCHES)
    if next(provenance_differences(one.attrs, other.attrs), None) is None:
        pytest.skip("this processor has none of the features that the switch takes away")
    reported = {section.name: " ".join(section.lines) for section in diff_archives(one, other)}
    assert "cpu features: " in reported.pop("made with")
    # Some features change no bit of this study: AVX2 does not, where there is no AVX-512.
    if reported:
        assert reported["equal"].startswith("all numbers, within 1e-09 ")
