"""Random inputs: distributions with units, the law that joins them, and where it ends."""
