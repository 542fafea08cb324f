"""Comparison of what runs were made with: models, files, settings."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from uqpen.archive.provenance import provenance_differences
from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.dependency import IMPORTED, LIBRARY, MODULE, OPENED, Dependency
from uqpen.core.labels import DEPENDENCIES, RUNS
from uqpen.core.status import Status
from uqpen.execution import status_counts
from uqpen.models.dependencies import current_sha256
from uqpen.study.identity import MODEL_PREFIX, ModelIdentity, StudyIdentity

_SOURCE, _VERSION = "source_sha256", "version"

_CHECKSUM = "checksum"

# Excerpt of a text that has changed: its length, and its length before the first difference.
_LONGEST, _BEFORE = 60, 20

_MOST_LISTED = 6

# Keys of hashes.
_HASHED = ("file ", "module ", "environment variable ")


class ModelComparison(NamedTuple):
    """Comparison of the model of an archive with that of a study."""

    changes: tuple[str, ...]  # what has changed, in words; empty if both would make the same runs
    # What the archive's runs depend on besides their inputs, as in `Results.files`.
    dependencies: frozenset[str] = frozenset()
    is_same_limit: bool = True  # true if both have the same limit on the time of a run
    is_same_domain: bool = True  # true if both studies have the same constraints
    # What the archive's runs were made with, where that is not as it is here, in words.
    made_with: tuple[str, ...] = ()


def compare_models(model: ModelIdentity, archived: ModelIdentity) -> ModelComparison:
    """Compare a model of an archive with one of a study; nothing of the archive is executed.

    What the archive's runs depend on is compared with what is there now, under the same names, also
    what only a run has imported or read.
    """
    if model.unknown:
        return ModelComparison((model.unknown,))
    # Those that it opens are compared below: a start may have written what the next one reads.
    opened = {each.name for each in model.dependencies if each.role in (OPENED, LIBRARY)}
    own = [name for name in model.files if name not in opened]
    before, now = (
        {
            **each.table,
            **_versions(each.attributes, model),
            **{f"file {name}": each.files[name] for name in own if name in each.files},
            **used,
        }
        for each, used in zip(
            (archived, model), _compared_dependencies(model, archived.dependencies), strict=True
        )
    )
    changed = list(fingerprint_changes(before, now))
    software = {key: archived.software[key] for key in model.software if key in archived.software}
    differences = provenance_differences(software, model.software)
    others = ", ".join(f"{what} {then}" for what, then, _ in differences)
    domain = [each.text for each in fingerprint_changes(archived.constraints, model.constraints)]
    changes = [change.text for change in changed if not change.is_limit]
    return ModelComparison(
        (*changes, *(domain if model.depends_on_batch else ())),
        frozenset(each.line for each in archived.dependencies),
        not any(change.is_limit for change in changed),
        not domain,
        (f"runs made with {others}",) if others else (),
    )


def compared_names(
    model: ModelIdentity, lines: Iterable[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what is compared of a model whose runs are taken, and what is not.

    Parameters
    ----------
    lines : iterable of str
        What the runs depend on, as in `Results.files`.

    Returns
    -------
    same : tuple of str
        Names of files, modules and variables of the environment that were compared. The model's
        table in the study is not named.
    uncompared : tuple of str
        What decides the runs and was not compared, in words, such as
        ``"what ./solver reads and starts"``.
    """
    found = sorted({*map(Dependency.from_line, lines), *model.dependencies})
    names = [*model.files, *(each.name for each in found if each.sha256)]
    unhashed = filter(None, (each.uncompared for each in found))
    return tuple(dict.fromkeys(names)), tuple(dict.fromkeys([*model.uncompared, *unhashed]))


def _compared_dependencies(
    model: ModelIdentity, archived: Sequence[Dependency]
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the hashes of what archived runs depend on, by name: in the archive, and now.

    Modules that the model has loaded now are compared, too, if the archive has none of their names:
    a source decides what is imported. That it opens another file follows from one that has changed.
    """
    known = {each[:2]: each.sha256 for each in model.dependencies}
    before: dict[str, str] = {}
    now: dict[str, str] = {}
    with model.surroundings.on_import_path() if model.surroundings else nullcontext():
        for each in archived:
            if each.sha256:
                found = known.get(each[:2]) or current_sha256(each, model.folder)
                before[each.label] = each.sha256
                now |= {each.label: found} if found else {}
    roles = (IMPORTED, MODULE)
    now |= {
        Dependency(*key).label: sha256 for key, sha256 in sorted(known.items()) if key[0] in roles
    }
    return before, now


def _versions(attributes: Mapping[str, str], model: ModelIdentity) -> dict[str, str]:
    """Return attributes without what follows from files, or from the source of the model."""
    replaced = _VERSION if _SOURCE in attributes else ""
    left_out = replaced if model.surroundings is None else _SOURCE
    return {f"model {key}": value for key, value in attributes.items() if key != left_out}


def is_unchanged(
    study: StudyIdentity, archived: StudyIdentity, comparisons: Mapping[str, ModelComparison]
) -> bool:
    """Check that a study would make the archive again that is there: text, files, versions.

    If that is not sure, as something comes from an installed package or is an object of a program,
    it is not unchanged. `comparisons` are those with the models of the same names.
    """
    # Models are compared by themselves, also by what only their runs have used.
    kept = {
        key: value
        for key, value in study.attributes.items()
        if not key.startswith(MODEL_PREFIX) and key != DEPENDENCIES
    }
    if (
        not study.is_known
        or any(str(archived.attributes.get(key)) != str(value) for key, value in kept.items())
        or [*comparisons] != [*study.models]
        or any(each.changes or not each.is_same_limit for each in comparisons.values())
    ):
        return False
    # Some of these are opened or imported by a run alone.
    compared = {
        name
        for model, found in comparisons.items()
        for name in compared_names(study.models[model], found.dependencies)[0]
    }
    now, then = (
        {name: sha256 for name, sha256 in each.files.items() if name not in compared}
        for each in (study, archived)
    )
    return now == then


def has_missing_runs(tree: xr.DataTree) -> bool:
    """Check whether an archive has failed runs that another attempt might not lose."""
    return any(
        any(
            count and status > Status.INADMISSIBLE
            for status, count in status_counts(read_group(model, RUNS, design)).items()
        )
        for model in model_trees(tree).values()
        for design in group_names(model, RUNS)
    )


def read_fingerprint(record: Path) -> dict[str, str] | None:
    """Read the fingerprint of the runs beside a record; None for a damaged one."""
    try:
        content: Any = json.loads(record.read_bytes())
        checksum = content.pop(_CHECKSUM)
    except (OSError, ValueError, RecursionError, AttributeError, KeyError, TypeError):
        return None
    return content if checksum == _checksum(content) else None


def encode_fingerprint(fingerprint: Mapping[str, str]) -> bytes:
    """Encode a fingerprint as the content of a record, with its checksum."""
    return json.dumps({_CHECKSUM: _checksum(fingerprint), **fingerprint}, indent=1).encode()


def was_record_of(record: Path, fingerprint: Mapping[str, str]) -> bool:
    """Check that a damaged record had a fingerprint: its checksum, or all else, is left of it."""
    try:
        damaged, whole = record.read_bytes(), encode_fingerprint(fingerprint)
    except OSError:
        return False
    return any(line in damaged for line in whole.split(b"\n", 2)[1:])


def _checksum(fingerprint: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(fingerprint).encode()).hexdigest()


# Changes in words.


class Change(NamedTuple):
    """Changed entry of a fingerprint: its key, and a text for display."""

    key: str
    text: str

    @property
    def is_limit(self) -> bool:
        """True if the changed value is the time limit of a run."""
        return self.key.startswith("model") and self.key.endswith(".time_limit")

    @property
    def is_reading(self) -> bool:
        """True if the changed value belongs to `[model.read]`."""
        return re.match(r"model(s\.[^.]+)?\.read\b", self.key) is not None


def fingerprint_changes(before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[Change]:
    """Yield the differences between two fingerprints."""
    for key in {**before, **now}:
        was, is_now = (str(each.get(key, "not there")) for each in (before, now))
        if was == is_now:
            continue
        is_hash = key.startswith(_HASHED) or key.endswith("sha256")
        if is_hash and key in before and key in now:
            yield Change(key, f"{key} has changed")
        else:
            was, is_now = _excerpts(" ".join(was.split()), " ".join(is_now.split()))
            yield Change(key, f"{key} was {was}, is {is_now}")


def list_changes(changes: Sequence[str]) -> str:
    """Return changes as indented lines; of many the first ones."""
    more = len(changes) - _MOST_LISTED
    lines = [*changes[:_MOST_LISTED], *([f"and {more} more"] if more > 0 else [])]
    return "\n".join(f"  {line}" for line in lines)


def _excerpts(before: str, now: str) -> list[str]:
    """Shorten two texts to fit on a line; cut both shortly before their first difference.

    >>> _excerpts("1" * 100 + "2", "1" * 100 + "3")
    ['…111111111111111111112', '…111111111111111111113']
    """
    pairs = zip(before, now, strict=False)
    same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    start = max(0, same - _BEFORE) if max(len(before), len(now)) > _LONGEST else 0
    return [
        "…" * (start > 0) + text[start:][:_LONGEST] + "…" * (len(text) - start > _LONGEST)
        for text in (before, now)
    ]
