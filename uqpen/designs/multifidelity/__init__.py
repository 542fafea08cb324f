"""Multifidelity designs: a dear model at few points, and its cheap stand-ins at many."""
