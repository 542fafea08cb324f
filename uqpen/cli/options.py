"""Options and arguments that several commands share."""

from __future__ import annotations

import functools
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from uqpen.cli.messages import show_message
from uqpen.core.lookup import resolve
from uqpen.execution import EXECUTORS, ExecutorDetail

if TYPE_CHECKING:
    from uqpen.designs.stopping.precision import Precision
    from uqpen.execution import Map
    from uqpen.study.study import ValidatedStudy

PATH = click.Path(path_type=Path)


class ExecutorOptions(NamedTuple):
    """Executor that a command was asked for: its name, its value, and the text of its detail."""

    name: str
    value: int | str
    detail: str = ""

    @property
    def preparation(self) -> str:
        """Step before the first run, in words; empty for none."""
        executor = EXECUTORS[self.name]
        is_here = self.value == executor.in_this_process
        return "" if is_here else executor.step.format(self.value)

    def open_map(self) -> AbstractContextManager[Map]:
        """Return a map over batches of runs."""
        executor = EXECUTORS[self.name]
        if self.value == executor.in_this_process:
            return nullcontext(map)
        arguments = [self.value, *([self.detail] if executor.detail else [])]
        reports = [show_message] if executor.reports else []
        opened: AbstractContextManager[Map] = resolve(executor.function)(*arguments, *reports)
        return opened


def executor_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of where to make runs, as its argument `executor`."""

    @functools.wraps(command)
    def run_command(*arguments: Any, **options: Any) -> Any:
        values = {name: options.pop(name) for name in EXECUTORS}
        details = {name: options.pop(each.name) for name, each in _details().items()}
        given = [name for name, value in values.items() if value is not None]
        if len(given) > 1:
            raise click.UsageError(f"--{' and --'.join(given)} exclude each other")
        for name, detail in _details().items():
            if details[name] is not None and name not in given:
                raise click.UsageError(f"--{detail.name} is for --{name}")
        executor = ExecutorOptions("workers", 1)
        for name in given:
            executor = ExecutorOptions(name, values[name], details.get(name) or "")
        return command(*arguments, executor=executor, **options)

    for name, each in reversed(EXECUTORS.items()):
        if (detail := each.detail) is not None:
            run_command = click.option(
                f"--{detail.name}", detail.name, metavar=detail.metavar, help=detail.help
            )(run_command)
        kind = click.IntRange(min=1) if each.is_count else None
        run_command = click.option(
            f"--{name}", name, type=kind, metavar=each.metavar, help=each.help
        )(run_command)
    return run_command


def _details() -> dict[str, ExecutorDetail]:
    """Return the further options of executors, by the names of these."""
    return {name: each.detail for name, each in EXECUTORS.items() if each.detail}


# Key of the context of a command that shows no progress.
_QUIET = "uqpen.quiet"


def _be_quiet(context: click.Context, parameter: click.Parameter, value: bool) -> None:
    context.meta[_QUIET] = value


quiet_option = click.option(
    "-q",
    "--quiet",
    is_flag=True,
    expose_value=False,
    callback=_be_quiet,
    help="Show no progress; results, warnings and errors are shown.",
)


def is_quiet() -> bool:
    """Check that the command shows no progress."""
    context = click.get_current_context(silent=True)
    return context is not None and context.meta.get(_QUIET, False)


def output_option(name: str, default: str) -> Callable[..., Any]:
    """Give a command the path of the archive that it writes, as its argument `name`."""
    text = f"The archive to write.  [default: {default}]"
    return click.option("-o", "--output", name, type=PATH, help=text)


def resume_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the flags of `ResumeOptions`, about finished runs."""
    fresh = "Make all runs, also those that are finished, and replace the archive in any case."
    repeat_failed = "Repeat the finished runs that failed."
    read_again = "Read the kept folders of runs again, in place of making the runs."
    recheck = (
        "Make some finished runs again first, to see that they are the same; or none.  "
        "[default: unless one takes long]"
    )
    command = click.option("--recheck/--no-recheck", default=None, help=recheck)(command)
    command = click.option("--read-again", is_flag=True, help=read_again)(command)
    repeat_option = click.option("--lost-again", "repeat_failed", is_flag=True, help=repeat_failed)
    command = repeat_option(command)
    return click.option("--fresh", is_flag=True, help=fresh)(command)


def folder_option(study: str = "its study") -> Callable[..., Any]:
    """Give a command the folder of the files that an archived study names."""
    return click.option(
        "--folder",
        type=click.Path(exists=True, file_okay=False, path_type=Path),
        help=f"Folder with the files that {study} names.  [default: the archived files]",
    )


trust_option = click.option(
    "--trust",
    is_flag=True,
    help="Execute code that ARCHIVE names: models, distributions, designs, surrogates, analyses.",
)


# Wanted precision: a table as in a study file.

EXAMPLE = '{ depth = { mean = "1 %" } }'


def read_precision(written: str, study: ValidatedStudy) -> Precision:
    """Return the precision that the option ``--until`` states; a mistake in it is one of usage."""
    import tomllib

    from uqpen.core.errors import SettingsError
    from uqpen.designs.stopping.precision import Precision

    try:
        rule = Precision(tomllib.loads(f"until = {written}")["until"])
        problems = list(rule.check_outputs(study.quantities_of_interest))
        if problems:
            raise SettingsError(problems)
    except tomllib.TOMLDecodeError:
        raise click.UsageError(f"--until: found {written}; expected {EXAMPLE}") from None
    except SettingsError as error:
        raise click.UsageError(f"--until: {error}") from None
    return rule
