"""Content of the page of a study, section by section, and what the sections share."""
