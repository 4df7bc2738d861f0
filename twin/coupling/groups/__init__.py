"""Several coupled components as one component."""
