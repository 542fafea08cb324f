"""Statistics of a surrogate: sampled, from pick-freeze pairs, or in closed form."""
