"""A reduced body as it stands in memory: its own modes, its compliance, how good it is, how it agrees with another."""
