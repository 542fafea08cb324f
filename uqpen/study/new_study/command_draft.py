"""Draft of a study of a program, from its command and a template of its input file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from uqpen.core.errors import ModelError
from uqpen.models.command.program import names_in
from uqpen.study.new_study.draft import Draft, DraftInput, check_names

__all__ = ["command_draft"]

# Placeholders of files that a program reads or writes by itself.
_PATHS = ("inputs", "outputs")
# Where a result stands is not known: here in a line of its own.
_READING = r"""result = { text = "stdout", pattern = 'result *= *(\S+)' }  # FILL IN: its place"""
_ENDINGS = (".template", ".tmpl", ".tpl", ".in")


def command_draft(words: Sequence[str], template: Path | None, reference: str) -> Draft:
    """Return the draft of a study of a program.

    Parameters
    ----------
    words : sequence of str
        The program and its arguments.
    template : Path or None
        A file with a placeholder ``{name}`` for each input, if there is one.
    reference : str
        The path of the template as the study names it.

    Raises
    ------
    ModelError
        If the template cannot be read, or nothing has a placeholder.
    """
    if not words:
        raise ModelError("--command: found nothing, expected a program and its arguments")
    text = " ".join(words) + (f"\n{_read(template)}" if template else "")
    names = sorted(names_in(text) - {*_PATHS, ""}, key=lambda name: text.index(f"{{{name}"))
    if not names:
        where = (
            f"neither {template} nor the command has" if template else "the command does not have"
        )
        raise ModelError(f"{where} a placeholder such as {{load}} for an input")
    check_names(names, "placeholder")
    model = [f"command = {json.dumps(list(words), ensure_ascii=False)}"]
    model.append('# time_limit = "10 min"  # of one run')
    if template:
        file = json.dumps(_run_file(template), ensure_ascii=False)
        model += ["\n[model.templates]", f"{file} = {json.dumps(reference, ensure_ascii=False)}"]
    writes_json = "{outputs}" in text
    return Draft(
        title=Path(words[0]).name,
        model=tuple(model),
        inputs=tuple(map(DraftInput, names)),
        outputs=("result",),
        knows_outputs=False,
        readings=() if writes_json else (_READING,),
    )


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ModelError(f"{path}: is not UTF-8") from None


def _run_file(template: Path) -> str:
    """Return the name of the file that a template makes in the folder of a run."""
    name = template.name
    ending = next((each for each in _ENDINGS if name.endswith(each) and name != each), "")
    return name.removesuffix(ending) if ending else name
