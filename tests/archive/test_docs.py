"""What the documentation prints of an archive is what stands in one."""

import doctest
import gzip
import re
from pathlib import Path

import pytest

from uqpen.archive.provenance import SCHEMA
from uqpen.core.files import LARGEST

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "archive.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_it_opens_as_shown_without_uqpen(tmp_path, monkeypatch):
    packed = ROOT / "tests" / "data" / "archives" / f"schema_{SCHEMA}.nc.gz"
    (tmp_path / "study.nc").write_bytes(gzip.decompress(packed.read_bytes()))
    monkeypatch.chdir(tmp_path)
    section = PAGE.partition("## Opening it without uqpen")[2]
    examples = "".join(re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL))
    test = doctest.DocTestParser().get_doctest(examples, {}, "archive.md", None, 0)
    assert len(test.examples) > 10
    reported = []
    doctest.DocTestRunner(verbose=False).run(test, out=reported.append)
    assert reported == []


def test_it_tells_the_schema_that_is_written():
    assert f"This uqpen writes schema {SCHEMA} " in PAGE
    assert LARGEST == 1024**2
    assert "more than 1 MiB" in PAGE
