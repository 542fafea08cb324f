"""The results that a person or a script reads, from the archive alone."""
