"""Content of the page of a benchmark of methods."""
