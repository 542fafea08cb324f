"""Texts of earlier archives in their present wording."""

from __future__ import annotations

import re

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from uqpen.archive.estimates import estimate_array
from uqpen.archive.reworded import REWORDED, reworded, reworded_array
from uqpen.statistics import texts

PLACEHOLDER = r"\{(\w+)[^}]*\}"
VALUES = st.from_regex(r"[a-z0-9_.%]+", fullmatch=True)

WRITTEN = [
    re.compile(".+".join(map(re.escape, re.sub(PLACEHOLDER, "\0", value).split("\0"))))
    for name, value in vars(texts).items()
    if name.isupper() and isinstance(value, str)
]


# Notes on surrogates that were only compared with runs: archives have them, none is written.
OF_COMPARISONS = (
    "inside the ",
    "outside the ",
    "no independent runs ",
    "failed runs are missing from ",
    "{share} % of the variance is outside ",
    "sampling of the surrogate alone: ",
)


@pytest.mark.parametrize(
    "new", sorted(each for each in {*REWORDED.values()} if not each.startswith(OF_COMPARISONS))
)
def test_a_present_wording_is_one_that_is_written(new: str) -> None:
    note = new.removesuffix("; {note}")
    assert any(each.fullmatch(note) for each in WRITTEN)


@pytest.mark.parametrize("old", REWORDED)
def test_an_earlier_wording_is_not_written_any_more(old: str) -> None:
    own = [value for value in vars(texts).values() if isinstance(value, str)]
    assert old not in own
    assert set(re.findall(PLACEHOLDER, old)) == set(re.findall(PLACEHOLDER, REWORDED[old]))


@pytest.mark.slow
@given(st.lists(st.sampled_from([*REWORDED]), min_size=1, max_size=3), st.data())
def test_notes_are_reworded_with_their_values(earlier: list[str], data: st.DataObject) -> None:
    old, new = [], []
    for template in earlier:
        values = {name: data.draw(VALUES) for name in re.findall(PLACEHOLDER, template)}
        old.append(template.format(**values))
        new.append(REWORDED[template].format(**values))
    assert reworded("; ".join(old)) == "; ".join(new)
    assert reworded("; ".join(new)) == "; ".join(new)


@given(st.text())
def test_any_other_text_stays(text: str) -> None:
    assert reworded(text) == text


def test_a_note_within_a_note_is_reworded() -> None:
    assert reworded(
        "12 % of the variance lies beyond all outputs that the surrogate was fitted to, and no "
        "independent runs to hold it against; includes correlation"
    ) == (
        "12 % of the variance is outside the training range of the surrogate; no independent runs "
        "to compare with; includes correlation"
    )


@pytest.mark.parametrize("shape", [(), (2,)])
def test_an_array_is_reworded_in_all_its_texts(shape: tuple[int, ...]) -> None:
    array = estimate_array(
        np.zeros((*shape, 3)),
        dict(zip("a", shape, strict=False)),
        {
            "interval": "Student t, missing runs counted both ways",
            "interval_label": "none",
            "note": "no run came back",
        },
        units="m",
        long_name="mean of no run came back",
        attributes={"estimand": "indices of the input law", "runs": 3},
    )
    found = reworded_array(array)
    assert set(np.ravel(found["interval"])) == {"Student t, for any outcome of the missing runs"}
    assert set(np.ravel(found["note"])) == {"no run completed"}
    assert found.attrs == {
        "units": "m",
        "long_name": "mean of no run came back",
        "estimand": "indices of the input distribution",
        "runs": 3,
    }
    assert array.attrs["estimand"] == "indices of the input law"
    xr.testing.assert_equal(found.variable, array.variable)
