"""Scenario files: nodes with locations, merging, overrides, writing."""
