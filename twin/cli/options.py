"""Options that several commands share, each defined once, and the former spellings of renamed options.

A decorator made by `option` accepts the former spellings of an option for one release: they are hidden from the help text,
and their use prints a note on stderr.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from twin.cli.terminal import say

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from twin import clock

Decorated = TypeVar("Decorated", bound="Callable[..., Any] | click.Command")

BACKENDS = ("fmu", "compiled", "interpreted")
SET_EXAMPLE = "heart.rate='1.4 Hz'"
PLATFORMS = ("x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin")


class RenamedOption(click.Option):
    """An option that also accepts its former spellings."""

    def __init__(self, *args: Any, former: Sequence[str] = (), **attributes: Any) -> None:
        super().__init__(*args, **attributes)
        self.former = former

    def add_to_parser(self, parser: Any, ctx: click.Context) -> None:
        """Register each former spelling under a name of its own, so that its use is noticed."""
        super().add_to_parser(parser, ctx)
        for spelling in self.former:
            twin = copy.copy(self)
            twin.opts, twin.secondary_opts, twin.name = [spelling], [], spelling
            click.Option.add_to_parser(twin, parser, ctx)

    def handle_parse_result(
        self, ctx: click.Context, opts: Mapping[str, Any], args: list[str]
    ) -> tuple[Any, list[str]]:
        """Take over the values of former spellings; a value under the present spelling has precedence."""
        merged, name = dict(opts), str(self.name)
        for spelling in self.former:
            if spelling not in merged:
                continue
            value = merged.pop(spelling)
            merged[name] = [*value, *merged.get(name, [])] if self.multiple else merged.get(name, value)
            if not ctx.resilient_parsing:
                say(
                    f"note: {spelling} is now {max(self.opts, key=len)}; the old spelling ends with the next release.",
                    err=True,
                )
        return super().handle_parse_result(ctx, merged, args)


def option(*declarations: str, former: Sequence[str] = (), **attributes: Any) -> Callable[[Decorated], Decorated]:
    """`click.option` that also accepts the spellings `former`."""
    return click.option(*declarations, cls=RenamedOption, former=former, **attributes)


def folder_option(spelling: str, default: str, text: str, name: str | None = None) -> Callable[[Decorated], Decorated]:
    """An option that names a folder."""
    return click.option(
        spelling,
        name or spelling.removeprefix("--"),
        type=click.Path(file_okay=False, path_type=Path),
        default=Path(default),
        show_default=True,
        metavar="DIR",
        help=text,
    )


overrides_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="PATH=VALUE",
    help=f"Override a value of the scenario, e.g. {SET_EXAMPLE}, stop_time='30 s' or seeds='[1, 2]'. Repeatable.",
)
variant_option = click.option("--variant", metavar="NAME", help="Variant of the scenario.  [default: the first]")
seed_option = click.option("--seed", type=int, metavar="N", help="Random seed.  [default: the scenario's first]")
backend_option = option(
    "--backend",
    former=("--as", "--form"),
    type=click.Choice(BACKENDS),
    default=BACKENDS[0],
    show_default=True,
    help="How the project's own components are executed; results are identical to the bit.",
)
hardware_option = click.option(
    "--hardware",
    "hardware_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Hardware file: CANopen drives, simulated or real, that replace members of the scenario.",
)
arm_option = click.option("--arm", is_flag=True, help="Allow real drives to move.")
runs_option = folder_option("--runs", "runs", "Folder of results.")
build_option = folder_option("--build", "build", "Folder of FMUs and compiled code.")
no_report_option = click.option("--no-report", is_flag=True, help="Do not write the HTML report.")
verbose_option = click.option(
    "--verbose", is_flag=True, help="Print all metrics, and passed and skipped requirements in full."
)
force_option = click.option("--force", is_flag=True, help="Replace existing files.")
no_open_option = click.option("--no-open", is_flag=True, help="Print the URL; do not open a browser.")
signal_option = click.option(
    "--signal",
    "--signals",
    "patterns",
    multiple=True,
    metavar="NAME",
    help="Signal or pattern to include, e.g. 'sensor.*'. Repeatable.",
)
filter_option = option(
    "--filter", "text", former=("--matching",), default="", metavar="TEXT", help="List only entries that contain TEXT."
)
platform_option = click.option(
    "--platform",
    "platforms",
    multiple=True,
    type=click.Choice((*PLATFORMS, "all")),
    metavar="PLATFORM",
    help=f"Target platform: {', '.join(PLATFORMS)} or all. Repeatable.  [default: this machine]",
)
picture_option = click.option(
    "--output",
    "-o",
    callback=lambda *values: check_picture(values[-1]),
    metavar="FILE.svg",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Also write the result as a picture.",
)


def timeout_option(text: str, default: float = 0.0, *, show_default: bool = False) -> Callable[[Decorated], Decorated]:
    """`--timeout` in seconds; 0 means none."""
    return click.option(
        "--timeout", type=click.FloatRange(0.0), default=default, show_default=show_default, metavar="S", help=text
    )


def duration_option(spelling: str, text: str, *, required: bool = False) -> Callable[[Decorated], Decorated]:
    """An option that is a positive time; the command gets it in nanoseconds, 0 if it is not given."""

    def parse(_context: click.Context, _option: click.Parameter, value: str | None) -> clock.Time:
        if value is None:
            return 0
        from twin.scenario import duration

        try:
            time = duration(value)
        except ValueError as error:
            raise click.UsageError(f"{spelling} {value}: {error}.") from None
        if time <= 0:
            raise click.UsageError(f"{spelling} {value}: is not positive. Give a time such as 10s.")
        return time

    return click.option(spelling, callback=parse, required=required, metavar="DURATION", help=text)


def restart_options(command: Decorated) -> Decorated:
    """`--starts` and `--seed` of a fit."""
    seed = click.option(
        "--seed",
        type=click.IntRange(0, 2**31 - 1),
        default=0,
        show_default=True,
        metavar="N",
        help="Random seed of a fit, for its restarts and bootstrap.",
    )
    starts = click.option(
        "--starts",
        type=click.IntRange(1, 10_000),
        default=8,
        show_default=True,
        metavar="N",
        help="Number of random restarts of a fit.",
    )
    return starts(seed(command))


def port_option(first: int) -> Callable[[Decorated], Decorated]:
    """`--port` of a page, from `first` on."""
    return click.option(
        "--port", type=click.IntRange(first, 65535), metavar="N", help="TCP port of the page.  [default: a free port]"
    )


def check_picture(path: Path | None) -> Path | None:
    """Refuse a picture that is not an SVG file."""
    if path is not None and path.suffix != ".svg":
        raise click.UsageError(f"-o {path}: only SVG can be written. Use -o {path.stem}.svg.")
    return path


def refuse_existing(path: Path, force: bool) -> None:
    """Refuse to replace a file without `--force`."""
    if path.exists() and not force:
        from twin.errors import TwinError

        raise TwinError(f"{path} exists. Use --force to replace it, or -o to name another file.")
