"""Names in a scenario, resolved to components and variables."""
