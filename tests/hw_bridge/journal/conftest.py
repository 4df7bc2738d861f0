"""Files that a test leaves open, as a process that was killed does, are closed at its end."""

import pytest

from hw_bridge.journal import JournalFile


@pytest.fixture(autouse=True)
def files_are_closed(monkeypatch):
    opened = []
    plain = JournalFile.__init__

    def noted(self, *arguments):
        plain(self, *arguments)
        opened.append(self)

    monkeypatch.setattr(JournalFile, "__init__", noted)
    yield
    for one in opened:
        one.file.close()
