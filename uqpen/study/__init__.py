"""The study file: TOML into a frozen, validated study, every mistake met before a model runs."""
