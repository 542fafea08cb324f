"""A study made into an archive, from wherever an earlier start has come to."""
