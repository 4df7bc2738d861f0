"""A set whose model is a formula: what a prediction is, is known."""

from types import SimpleNamespace

import numpy as np

from twin.errors import SimulationError
from twin.identify import Unknown
from twin.validation.model import Quantity
from twin.validation.schema import FoldKeys

REST = Unknown("rest", "rad", -1.0, 3.0, 0.5, member="model", variable="rest", display_unit="deg")
GAIN = Unknown("gain", "", 0.5, 8.0, 1.0, is_log=True, member="model", variable="gain")


class Formula:
    """Outputs a [rad], x and y [m] of one input: a = rest + gain u, x = u, y = -u; or `function(u, values)`.

    `fails`: whether values cannot be simulated.
    """

    def __init__(self, fit=(), rezero=(), *, function=None, fails=lambda _values: False, **keys):
        self.name = "sines"
        signals = {"a": ("angle", None), "x": ("tip_x", None), "y": ("tip_y", None)}
        self.outputs = list(signals)
        self.keys = SimpleNamespace(
            outputs={c: SimpleNamespace(signal=s, noise=noise) for c, (s, noise) in signals.items()},
            equal_files=False,
            folds=FoldKeys(**keys.pop("folds", {})),
            component="formula",
            **{"train_window": None, **keys},
        )
        self.units = {"angle": "rad", "tip_x": "m", "tip_y": "m", "rest": "rad", "gain": ""}
        self.quantities = [Quantity("bending", "deg", (0,), 180 / np.pi), Quantity("tip", "mm", (1, 2), 1e3)]
        self.source_hash = "now"
        self._unknowns = {"fit": list(fit), "rezero": list(rezero)}
        self._function, self._fails = function, fails

    def unknowns(self, group):
        return self._unknowns[group]

    def start(self, name):
        return {"rest": 0.5, "gain": 1.0}[name]

    def predict(self, data, values, corrections=None):
        values = {"rest": 0.5, "gain": 1.0, **values, **data.initial, **(corrections or {})}
        if self._fails(values):
            raise SimulationError("it fails")
        u = np.concatenate(data.inputs)[:, 0]
        if self._function:
            return self._function(u, values)
        return np.stack([values["rest"] + values["gain"] * u, u, -u], 1)
