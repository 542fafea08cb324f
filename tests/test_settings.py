"""What a study file must not say, a constructor refuses in the same words."""

import math
from pathlib import Path

import pytest

from uqpen.core.errors import SettingsError
from uqpen.core.limits import Limits
from uqpen.core.model import Output
from uqpen.distributions.univariate import Discrete
from uqpen.models.command.model import FolderPolicy
from uqpen.models.command.output_readers import CsvReader, JsonReader, NetcdfReader
from uqpen.statistics.published import Publication, PublishedEstimates
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

Y = Output("y", "m")


@pytest.mark.parametrize(
    ("make", "key", "expected"),
    [
        (lambda: Limits(seconds=0), "time_limit", 'a time such as "10 s"'),
        (lambda: Limits(bytes=1000), "memory_limit", "at least 1 MB"),
        (lambda: FolderPolicy("some", Path()), "keep", '"failed", "all" or "none"'),  # type: ignore[arg-type]
        (lambda: JsonReader("out.json", ""), "key", "names that lead to it"),
        (lambda: CsvReader("out.csv", "y", 0.5), "row", "a whole number"),  # type: ignore[arg-type]
        (lambda: NetcdfReader("out.nc", " "), "variable", "the name of a variable"),
        (lambda: QuantityOfInterest(Y, "m", quantiles=(0.5, 1)), "quantiles", "between 0 and 1"),
        (lambda: QuantityOfInterest(Y, "m", tolerance_contents=(2,)), "hold", "between 0 and 1"),
        (lambda: QuantityOfInterest(Y, "m", thresholds=(2.0,)), "exceeds", "thresholds"),  # type: ignore[arg-type]
        (lambda: PublishedEstimates(Y, mean=math.nan), "mean", "a quantity"),
        # TOML has whole numbers that no float can hold.
        (lambda: QuantityOfInterest(Y, "m", quantiles=(10**400,)), "quantiles", "between 0 and 1"),
        (lambda: PublishedEstimates(Y, response={"a": math.inf}), "response", "a table"),
        (lambda: Discrete(5), "values", "a list of quantities"),  # type: ignore[arg-type]
        (lambda: Discrete((1.0, 2.0), 3), "weights", "a list of numbers"),  # type: ignore[arg-type]
        (lambda: Publication(""), "source", "where the figures stand"),
    ],
)
def test_a_wrong_value_is_refused(make, key, expected):
    with pytest.raises(SettingsError) as caught:
        make()
    (problem,) = caught.value.problems
    assert problem.key == key
    assert expected in problem.expected
