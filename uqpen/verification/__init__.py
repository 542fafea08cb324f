"""Verification of archives: comparison with their hashes, with new runs and with each other."""
