"""What the page of methods run head to head says."""
