"""Recordings and the model of each experiment, from the keys of an identify file."""

import lazy_loader

__getattr__, _, _ = lazy_loader.attach(__name__, submodules=["replay"])
