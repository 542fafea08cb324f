"""Entry point: from arguments to a command, from its errors to an exit code."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import click

from uqpen import __version__
from uqpen.cli.messages import SPELLED_OUT, ExitCode, show_message
from uqpen.core.errors import TooManyFailedError, UqpenError
from uqpen.core.interrupts import interrupt_exit_code, record_interrupts
from uqpen.core.lookup import nearest, resolve
from uqpen.core.output_streams import lasting_streams, stream_error

_NAMES = (
    "init study check plan show export report figure compare rehearse replicate reweight verify "
    "diff rerun models run predict serve completion"
)
# The environment variable by which a shell asks for completions.
COMPLETION = "_UQPEN_COMPLETE"
# Commands that stand beside another of the same subject.
_BESIDE = {
    "figure": "show",
    "report": "show",
    "rerun": "verify",
    "diff": "verify",
    "completion": "main",
}
COMMANDS = {name: f"uqpen.cli.{_BESIDE.get(name, name)}:{name}" for name in _NAMES.split()}


class _Commands(click.Group):
    """A group that imports a command when it is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = resolve(COMMANDS[cmd_name])
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        close = None if args[0] in COMMANDS else nearest(args[0], COMMANDS)
        if close:
            ctx.fail(f"No such command '{args[0]}'. Did you mean '{close}'?")
        return super().resolve_command(ctx, args)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="uqpen")
def uqpen() -> None:
    """Uncertainty quantification for any model: a study in, an archive out.

    \b
    Start with:  uqpen study studies/concrete.toml
    """  # noqa: D301 - the \\b keeps the line that follows it as it is


def main() -> None:
    """Run the command line, and leave with its exit code."""
    # A terminal that lacks a character gets something like it, not a traceback.
    with lasting_streams(errors=SPELLED_OUT):
        if COMPLETION in os.environ:
            uqpen.main(prog_name="uqpen")  # it answers the shell, and leaves
        code = _run(sys.argv[1:])
        if error := stream_error():
            show_message(f"standard output cannot be written: {error}")
            code = code or ExitCode.MISTAKE
    sys.exit(interrupt_exit_code() if code == ExitCode.INTERRUPTED else code)


def _run(arguments: list[str]) -> int:
    """Run a command, report its error, and return its exit code."""
    try:
        Path.cwd()
    except OSError:
        show_message("the current folder does not exist any more")
        return ExitCode.MISTAKE
    try:
        # Not the group's own `main`, which ends the program itself.
        with record_interrupts(), uqpen.make_context("uqpen", arguments) as context:
            return uqpen.invoke(context) or ExitCode.DONE
    except click.exceptions.Exit as left:
        return left.exit_code
    except click.ClickException as error:
        shown = io.StringIO()
        error.show(file=shown)
        show_message(shown.getvalue().rstrip().expandtabs(2))
        return ExitCode.MISTAKE
    except UqpenError as error:
        show_message(str(error))
        are_too_many = isinstance(error, TooManyFailedError)
        return ExitCode.TOO_MANY_FAILED if are_too_many else ExitCode.MISTAKE
    except MemoryError:
        show_message("this computer does not have enough memory for this number of runs")
        return ExitCode.MISTAKE
    except (click.Abort, KeyboardInterrupt):
        show_message("interrupted")
        return ExitCode.INTERRUPTED


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

    root = click.get_current_context().find_root()
    found = get_completion_class(shell)
    assert found is not None  # as the choice names those that click has
    click.echo(found(root.command, {}, "uqpen", COMPLETION).source())
