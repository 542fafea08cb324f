"""Rehearsal of a study on its own surrogate: how often its intervals hold where truth is known."""
