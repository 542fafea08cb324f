"""Estimates of surrogates, corrected by real runs."""
