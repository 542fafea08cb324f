"""Core: errors, units, quantities, settings, variables, labels, files; what a model is."""
