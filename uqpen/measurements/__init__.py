"""Measurements of a model's outputs: experiments, their errors, and how well results fit."""
