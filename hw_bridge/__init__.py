"""Drives on a CAN bus: simulated ones here, the bridge to real ones beside them."""
