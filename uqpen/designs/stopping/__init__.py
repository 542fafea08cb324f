"""Stopping rules: how many runs of a design are enough. Each says so from estimates alone."""

from __future__ import annotations

__all__ = ["STOPPING_RULES"]

# By the key with which a study gives a design its rule.
STOPPING_RULES = {"until": "uqpen.designs.stopping.precision:Precision"}
