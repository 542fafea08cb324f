"""Core: errors, units, quantities, settings, variables, labels, files, model interface."""
