"""Drives on a CAN bus: simulated ones, and the bridge to them and to real ones."""
