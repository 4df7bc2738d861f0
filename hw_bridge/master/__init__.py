"""The master side of the bus: what makes a drive do what a member of the co-simulation says."""
