"""What a shell offers behind TAB where a command wants a name."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    import click
    from click.shell_completion import CompletionItem


def scenarios(_: click.Context, __: click.Parameter, begun: str) -> list[CompletionItem]:
    """Scenarios by name, and files."""
    from twin.scenario import scenario_paths

    return beginning(scenario_paths.scenarios(), begun)


def studies(_: click.Context, __: click.Parameter, begun: str) -> list[CompletionItem]:
    """Studies by name, and files."""
    from twin.scenario import scenario_paths

    return beginning(scenario_paths.scenarios("study"), begun)


def anything(_: click.Context, __: click.Parameter, begun: str) -> list[CompletionItem]:
    """Components and scenarios by name, and files."""
    from twin.component import catalog
    from twin.scenario import scenario_paths

    return beginning([*catalog.names(), *scenario_paths.scenarios()], begun)


def beginning(names: Iterable[str], begun: str) -> list[CompletionItem]:
    """Names that begin so; the shell adds files."""
    from click.shell_completion import CompletionItem

    return [*(CompletionItem(name) for name in names if name.startswith(begun)), CompletionItem(begun, type="file")]
