"""The components: one folder each, with `model.py`, `README.md` and `expected.csv`.

Code that several of them share stands beside the folders: `control.py` (force control law), `bouc_wen.py` (hysteresis).
"""
