"""A clock that stands until a test moves it."""


class Clock:
    """A clock that a test moves [ns]."""

    def __init__(self, monkeypatch, *modules):
        self.ns = 1_000_000_000
        for module in modules:
            monkeypatch.setattr(module, "time", self)

    def monotonic_ns(self):
        return self.ns

    def time_ns(self):
        return self.ns

    def monotonic(self):
        return self.ns / 1e9

    def sleep(self, seconds):
        self.ns += round(seconds * 1e9)
