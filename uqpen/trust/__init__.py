"""Surrogate validation: the estimates of a surrogate that independent runs confirm."""

from uqpen.trust.validation import VALIDATION_RULE, ValidationRuns, validate_surrogate

__all__ = ["VALIDATION_RULE", "ValidationRuns", "validate_surrogate"]
