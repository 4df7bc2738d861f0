"""Shell completion of names."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    import click
    from click.shell_completion import CompletionItem


def scenarios(_: click.Context, __: click.Parameter, prefix: str) -> list[CompletionItem]:
    """Complete names of scenarios, and files."""
    from twin.scenario import scenario_paths

    return matches(scenario_paths.scenarios(), prefix)


def studies(_: click.Context, __: click.Parameter, prefix: str) -> list[CompletionItem]:
    """Complete names of studies, and files."""
    from twin.scenario import scenario_paths

    return matches(scenario_paths.scenarios("study"), prefix)


def components_and_scenarios(_: click.Context, __: click.Parameter, prefix: str) -> list[CompletionItem]:
    """Complete names of components and scenarios, and files."""
    from twin.component import catalog
    from twin.scenario import scenario_paths

    return matches([*catalog.names(), *scenario_paths.scenarios()], prefix)


def matches(names: Iterable[str], prefix: str) -> list[CompletionItem]:
    """Return the names with a prefix; the shell adds files."""
    from click.shell_completion import CompletionItem

    return [*(CompletionItem(name) for name in names if name.startswith(prefix)), CompletionItem(prefix, type="file")]
