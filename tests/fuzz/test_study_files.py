"""Wrong study files of every sort: each is right, or refused in words under its name."""

from pathlib import Path
from random import Random

import pytest
import study_texts
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from properties import study_outcome

import uqpen

pytestmark = pytest.mark.slow

# One folder for all examples of a test: each overwrites the file of the one before.
bounded = settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
randoms = st.integers(0, 2**32).map(Random)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with the files that the studies name."""
    monkeypatch.chdir(tmp_path)
    study_texts.prepare(tmp_path)


@pytest.mark.parametrize("name", list(study_texts.STUDIES))
def test_the_studies_are_right_before_they_are_changed(name):
    text = study_texts.STUDIES[name]
    study = uqpen.parse_study(text)
    # Written anew, it is the same study.
    again = study_texts.toml(study_texts.tomllib.loads(text))
    assert uqpen.parse_study(again).designs == study.designs


@pytest.mark.parametrize("seed", range(10))
def test_other_values_keys_and_tables_are_no_traceback(seed):
    random, file = Random(seed), Path("mutant.toml")
    file.write_text(study_texts.mutant(random), encoding="utf-8")
    study_outcome(file, random)


@bounded
@given(randoms)
def test_damaged_bytes_and_lines_are_no_traceback(random):
    file = Path("mutant.toml")
    file.write_bytes(study_texts.damaged_bytes(random))
    study_outcome(file, random)


_KEYS = st.one_of(st.text(max_size=3), st.sampled_from(["model", "inputs", "use", "kind", "a"]))
_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_KEYS, inner, max_size=3),
    max_leaves=8,
)


@bounded
@given(st.dictionaries(st.sampled_from(["seed", "model", "models", "inputs", "x"]), _VALUES))
def test_anything_at_all_is_refused(content):
    file = Path("mutant.toml")
    file.write_text(study_texts.toml(without_nothing(content)), encoding="utf-8")
    assert study_outcome(file, Random(0)) == "refused"


def without_nothing(value):
    """TOML has no null; and no lone surrogates, which hypothesis does not make."""
    if isinstance(value, dict):
        return {key: without_nothing(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, list):
        return [without_nothing(inner) for inner in value if inner is not None]
    return value
