"""What the page of a study says, section by section, and what these share."""
