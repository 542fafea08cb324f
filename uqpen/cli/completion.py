"""``uqpen completion``: the lines that let a shell complete commands, options and files."""

from __future__ import annotations

import click

__all__ = ["completion"]


@click.command(short_help="Print the completion script of a shell.")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print what SHELL needs to complete commands, options and files of uqpen.

    \b
    bash:  echo 'eval "$(uqpen completion bash)"' >> ~/.bashrc
    zsh:   echo 'eval "$(uqpen completion zsh)"' >> ~/.zshrc
    fish:  uqpen completion fish > ~/.config/fish/completions/uqpen.fish
    """  # noqa: D301 - the \\b keeps the lines that follow it as they are
    from click.shell_completion import get_completion_class

    from uqpen.cli.main import COMPLETION

    root = click.get_current_context().find_root()
    found = get_completion_class(shell)
    assert found is not None  # as the choice names those that click has
    click.echo(found(root.command, {}, "uqpen", COMPLETION).source())
