"""Stability analysis of a coupling: growth of small deviations over one common period."""
