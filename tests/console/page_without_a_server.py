"""A page without server and browser: what it shows, and what its buttons, fields and timers do."""

import asyncio
import inspect
from contextlib import contextmanager

from nicegui import Client, core, ui
from nicegui import run as nicegui_run
from nicegui.events import GenericEventArguments
from nicegui.page import page as page_decorator


class Page:
    """Elements that are made within `with page:`. Timers do nothing until `tick`; threads of pages run at once."""

    def __init__(self, monkeypatch):
        self.timers, self.notes, self.downloads = [], [], []
        self.client = Client(page_decorator("/test"))
        monkeypatch.setattr(ui, "timer", lambda period, call, once=False: self.timers.append((period, call, once)))
        monkeypatch.setattr(ui, "notify", lambda text, **_: self.notes.append(text))
        monkeypatch.setattr(ui.download, "content", lambda *content: self.downloads.append(content))

        async def at_once(call, *arguments):
            return call(*arguments)

        monkeypatch.setattr(nicegui_run, "io_bound", at_once)

    def __enter__(self):
        self.client.__enter__()
        return self

    def __exit__(self, *error):
        self.client.__exit__(*error)

    def elements(self, kind=ui.element):
        """Elements of a kind that are shown, in the order of the page."""

        def below(element):
            yield element
            for child in [child for slot in element.slots.values() for child in slot.children]:
                yield from below(child)

        return [one for one in below(self.client.layout) if isinstance(one, kind)]

    def shown(self):
        """Texts of labels, buttons, links and badges that are visible."""
        kinds = (ui.label, ui.button, ui.link, ui.badge, ui.expansion)
        return [one.text for one in self.elements(kinds) if one.visible and one.text]

    def named(self, text, kind=ui.element):
        """The element with this text, or with this label for a screen reader."""
        (found,) = [
            one
            for one in self.elements(kind)
            if text in (getattr(one, "text", ""), one.props.get("aria-label")) and not isinstance(one, ui.tooltip)
        ]
        return found

    def tick(self):
        """Let each timer call once."""
        self.run(*[call for _, call, _ in self.timers])

    def press(self, text, event="click"):
        """Click a button, or do something else with an element."""
        self.send(self.named(text), event)

    def send(self, element, event, args=None):
        """What the browser sends of an element."""
        handlers = [one.handler for one in element._event_listeners.values() if one.type == event]
        assert handlers, f"{event} is not handled"
        arguments = GenericEventArguments(sender=element, client=self.client, args=args)
        self.run(*[lambda handler=handler: call(handler, arguments) for handler in handlers])

    def change(self, element, value):
        """The value of a field, as a user enters it."""
        self.run(lambda: element.set_value(value))

    def run(self, *calls):
        """Call functions, and wait for what they begin."""

        async def run():
            with looping():
                for one in calls:
                    with self.client.layout:
                        result = one()
                    if inspect.isawaitable(result):
                        await result
                while others := asyncio.all_tasks() - {asyncio.current_task()}:
                    await asyncio.gather(*others)

        asyncio.run(run())


def call(handler, arguments):
    """Call a handler with what it takes."""
    return handler(arguments) if inspect.signature(handler).parameters else handler()


@contextmanager
def looping():
    """NiceGUI's loop is that which runs."""
    before, core.loop = core.loop, asyncio.get_running_loop()
    try:
        yield
    finally:
        core.loop = before
