"""Designs for a rare event: they move their runs towards it, in standard normal space."""
