"""The table of the same problem by chaospy alone, by SALib alone and by uqpen with both."""

import re

import pytest

library_table = pytest.importorskip("library_table", reason="the folder of benchmarks is not here")

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


@pytest.mark.slow
def test_the_page_has_the_table_of_today():
    columns = library_table.measured()
    written = library_table.table(columns)
    page = library_table.PAGE.read_text(encoding="utf-8")
    shown = page.partition("<!-- comparison: begin -->\n")[2].partition("\n<!-- comparison: end")[0]
    assert _NUMBER.sub("#", shown) == _NUMBER.sub("#", written)
    numbers = [[float(each) for each in _NUMBER.findall(text)] for text in (shown, written)]
    # Another processor may round a figure the other way.
    assert numbers[0] == pytest.approx(numbers[1], abs=0.0101)
    for _, found in columns.values():
        for figure, exact in library_table.EXACT.items():
            if figure in found:
                # Five standard errors: those of 1 000 plain runs are 0.12 of the mean.
                assert found[figure][0] == pytest.approx(exact, abs=0.2), figure
    bars = [sum(each[1] == each[1] for each in found.values()) for _, found in columns.values()]
    assert bars == [0, 3, 5]
