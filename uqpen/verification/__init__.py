"""Archives held against their own hashes, against fresh runs, and against each other."""
