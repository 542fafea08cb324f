"""``uqpen reweight``: other distributions of the inputs by the runs of an archive."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.messages import ExitCode, loading
from uqpen.cli.options import PATH, folder_option, output_option, quiet_option, trust_option


@click.command(short_help="Answer for other distributions by the runs of an archive.")
@click.argument("archive", type=PATH)
@click.argument("file", type=PATH)
@output_option("target", "<study>_reweighted.nc beside ARCHIVE")
@click.option("--all", "everything", is_flag=True, help="Show all tables, as `uqpen show` does.")
@trust_option
@folder_option("the study of ARCHIVE")
@quiet_option
def reweight(
    archive: Path,
    file: Path,
    target: Path | None,
    everything: bool,
    trust: bool,
    folder: Path | None,
) -> ExitCode:
    """Answer the study FILE by the runs of ARCHIVE, whose inputs had other distributions.

    Each run gets a weight; no model runs. FILE is the study of ARCHIVE with other distributions of
    its random inputs. Where the weights leave too few effective runs, there is no interval, and the
    reason says so. Where their variance is infinite, the command refuses before it looks at a run.
    """
    from uqpen.cli.progress import show_step

    with show_step("reweighting the runs"), loading():
        from uqpen.cli.console import show_line
        from uqpen.cli.screen import show_answer, show_tables
        from uqpen.cli.show import announce_report
        from uqpen.reweighting import reweight as reweight_runs

        target = target or archive.parent / f"{file.stem}_reweighted.nc"
        found = reweight_runs(archive, file, target, folder=folder, trust=trust)
    if everything:
        show_tables(found)
    else:
        show_answer(found, target)
    show_line(f"archive: {target}")
    announce_report(target)
    return ExitCode.DONE
