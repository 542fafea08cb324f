"""Polynomial chaos: expansions of outputs in orthonormal polynomials."""
