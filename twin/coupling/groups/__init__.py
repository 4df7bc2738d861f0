"""Composition of coupled components into one component."""
