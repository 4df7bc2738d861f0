"""Derivatives of a model along directions of its state, for filters that need them, and fixed-lag smoothing."""
