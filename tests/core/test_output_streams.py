"""Standard streams that were closed when the program started."""

import sys

import pytest

from uqpen.core.output_streams import lasting_streams, stream_error


@pytest.mark.parametrize("name", ["stdout", "stderr"])
def test_a_closed_stream_can_be_written(name, monkeypatch):
    monkeypatch.setattr(sys, name, None)
    with lasting_streams():
        print("nobody reads this", file=getattr(sys, name))
        assert getattr(sys, name).encoding
        assert not stream_error()
    assert getattr(sys, name) is None
