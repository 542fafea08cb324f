"""Content of the page of a study, section by section, and their common parts."""
