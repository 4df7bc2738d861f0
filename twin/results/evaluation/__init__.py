"""Expressions over signals, metrics, and verdicts."""
