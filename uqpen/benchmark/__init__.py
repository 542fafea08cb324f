"""Methods head to head: at equal budgets, which is nearest to the truth, and by how much."""
