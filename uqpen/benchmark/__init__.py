"""Benchmark of methods: accuracy of their estimates at equal budgets, against a reference."""
