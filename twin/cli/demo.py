"""`twin demo`, and `twin` alone: three commands to begin with, and what each shows."""

from __future__ import annotations

import click

from twin.cli.terminal import say, show_text

EXAMPLES = {
    "twin run heart_wall_force": """Three force controllers hold a catheter with 0.2 N against a beating wall. The first time
        the models are compiled (half a minute). It ends with PASS, the figures beside the paper's, and a report.""",
    "twin view latest": """The last run in the browser: force, heart and gripper over time, zoomed with the mouse, and
        what was required of them.""",
    "twin console teleoperation": """A robot with a catheter in the browser: choose `by hand`, press Start, move it
        with the arrow keys, and watch the instrument and the forces.""",
}


@click.command("demo")
def command() -> None:
    """Show three commands to begin with, and what each of them shows: the same as `twin` alone."""
    show_examples()


def show_examples() -> None:
    """Print the commands, each with what it shows."""
    say("Digital twins of robotic catheters. Three things to try:")
    for line, shows in EXAMPLES.items():
        say()
        say(f"  {line}")
        show_text(" ".join(shows.split()), "      ")
    say()
    show_text("Your own component: `twin new my_part`. What there is: `twin list`. All commands: `twin --help`.")
