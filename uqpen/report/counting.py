"""Counts with their noun, in sentences."""

from uqpen.results.digits import count_text

__all__ = ["count_text"]
