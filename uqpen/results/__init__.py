"""What a person or a script reads of an archive, from the archive alone."""
