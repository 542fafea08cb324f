"""What holds for all tests."""

from __future__ import annotations

from hypothesis import settings

# The same examples each time: a test that fails now and then says nothing.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")
