"""Forecasts from an estimate, their keys, and bands as wide as past errors show."""
