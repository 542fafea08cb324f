"""Compare the archives of a commit with those of this checkout, estimate by estimate.

The same studies are run with both, on one machine, since last bits differ between processors. Their
archives are flattened, and must be equal to the bit: estimates, bounds, runs, statuses and texts.
The exit code is 0 where all is equal, 1 where something differs, and 2 where it cannot be told.

    python benchmarks/same_numbers.py --base main
    python benchmarks/same_numbers.py --base main --quick --cache ~/.cache/same_numbers
    python benchmarks/same_numbers.py --archives old.nc new.nc
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.metadata
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from flat_archive import Flat, Key, NoPlaceError, flat_archive

# Names of variables and attributes that are renamed on purpose, by the kind of what they are of:
# "root", "model", "sources", "runs", "surrogates", "trajectory", "files" and so on.
RENAMED: dict[str, dict[str, str]] = {}

# Attributes that a later commit adds or leaves out on purpose.
ADDED = frozenset({"display_units"})
GONE: frozenset[str] = frozenset()

# Beginnings of the names of statistics, and of their coordinates, that a later commit adds on
# purpose; one that the base has is compared.
ADDED_STATISTICS = ("percentile", "convergence_", "percent", "runs_so_far")

# Attributes that say which code made an archive, or where what stands; they are no result.
APART = frozenset(
    {
        "uqpen_schema",
        "interval_recipe",
        "surrogate_recipe",
        "content_sha256",
        "version_uqpen",
        "model_version",
        "model_source_sha256",
    }
)

ROOT = Path(__file__).resolve().parents[1]
OWN_STUDIES = Path(__file__).with_suffix("")
_PACKAGES = ("numpy", "scipy", "numba", "xarray", "netCDF4", "SALib")
_POINTS = ("cdf", "cdf_band")
_BOUNDS = ("estimate", "lower", "upper")


@dataclass(frozen=True)
class Case:
    """A study and what is made of it.

    Parameters
    ----------
    name : str
        Of the study's file, without its ending.
    is_shipped : bool
        Whether it is one of ``studies/``; the base commit's text is taken for both sides.
    is_quick : bool
        Whether it belongs to the few that are run at each step.
    command : tuple of str
        Which of uqpen's commands, and its options.
    exit_code : int
        The expected one.
    """

    name: str
    is_shipped: bool = False
    is_quick: bool = False
    command: tuple[str, ...] = ("study",)
    exit_code: int = 0


_COMPARE = ("compare", "--budget", "64,128", "--repeats", "10", "--reference", "4096")

CASES = (
    Case("brief", is_quick=True),
    Case("smooth", is_quick=True),
    # A design that loses all of its runs ends with 3.
    Case("lost_runs", exit_code=3),
    Case("dependent"),
    Case("categories"),
    Case("several"),
    Case("ended"),
    Case("methods", command=_COMPARE),
    Case("ishigami", is_shipped=True),
    Case("rods", is_shipped=True),
    Case("concrete", is_shipped=True),
)


class YardstickError(Exception):
    """A comparison that cannot be made."""


def main() -> int:
    """Compare what is asked; the exit code says whether it is equal."""
    arguments = _arguments()
    try:
        if arguments.archives:
            old, new = arguments.archives
            found = {new.name: compared(flat_archive(old), flat_archive(new))}
            _tell(new.name, found[new.name], arguments.lines)
        else:
            found = _of_commits(arguments)
    except (YardstickError, NoPlaceError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 2
    whole = Comparison()
    for comparison in found.values():
        whole.equal += comparison.equal
        whole.differences += comparison.differences
        whole.covered += comparison.covered
    if arguments.covered:
        for (kind, name), count in sorted(whole.covered.items()):
            print(f"{kind:14} {name:26} {count:7}")
    if whole.differences:
        counts = Counter(each.sort for each in whole.differences)
        print("different:", ", ".join(f"{count} {sort}" for sort, count in counts.items()))
        return 1
    print(f"equal to the bit: {whole.summary}")
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--base", metavar="COMMIT", help="what to compare this checkout with")
    what.add_argument("--archives", metavar=("OLD", "NEW"), nargs=2, type=Path)
    names = [case.name for case in CASES]
    parser.add_argument("--quick", action="store_true", help="only the smallest studies")
    parser.add_argument("--only", metavar="STUDY", action="append", choices=names)
    parser.add_argument("--without", metavar="STUDY", action="append", choices=names, default=[])
    parser.add_argument("--cache", metavar="DIR", type=Path, help="keeps the base's archives")
    parser.add_argument("--keep", metavar="DIR", type=Path, help="keeps all archives, to look at")
    parser.add_argument("--jobs", metavar="N", type=int, default=1, help="studies at a time")
    parser.add_argument("--lines", metavar="N", type=int, default=10, help="of each sort told")
    parser.add_argument("--covered", action="store_true", help="list the statistics that occur")
    return parser.parse_args()


# Running both sides


@dataclass(frozen=True)
class Side:
    """A checkout with which studies are run.

    Parameters
    ----------
    checkout : Path
        Its folder.
    studies : Path
        Where the studies stand, the same for both sides.
    archives : Path
        Where archives are written.
    """

    checkout: Path
    studies: Path
    archives: Path

    def check(self) -> None:
        """Make sure that a subprocess imports the package of this checkout.

        Raises
        ------
        YardstickError
            If it imports another.
        """
        done = self._python("-c", "import uqpen; print(uqpen.__file__)")
        if done.returncode or not Path(done.stdout.strip()).is_relative_to(self.checkout):
            raise YardstickError(f"not of {self.checkout}: {done.stdout}{done.stderr}")

    def make(self, case: Case) -> Path:
        """Make the archive of a study.

        Raises
        ------
        YardstickError
            If the command ends with another exit code than it should.
        """
        archive = self.archives / f"{case.name}.nc"
        command, *options = case.command
        study = str(self.studies / f"{case.name}.toml")
        done = self._python("-m", "uqpen", command, study, "-o", str(archive), *options)
        if done.returncode != case.exit_code:
            raise YardstickError(
                f"{case.name} with {self.checkout}: exit code {done.returncode}, "
                f"expected {case.exit_code}\n{done.stderr}"
            )
        return archive

    def _python(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *arguments],
            cwd=self.archives,
            env={**os.environ, "PYTHONPATH": str(self.checkout)},
            capture_output=True,
            text=True,
        )


def _of_commits(arguments: argparse.Namespace) -> dict[str, Comparison]:
    """Compare the archives of both sides, study by study."""
    commit = _git("rev-parse", "--verify", f"{arguments.base}^{{commit}}").strip()
    cases = [
        case
        for case in CASES
        if (case.is_quick or not arguments.quick)
        and case.name not in arguments.without
        and (not arguments.only or case.name in arguments.only)
    ]
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        studies, folders = scratch / "studies", [scratch / name for name in ("base", "new")]
        shutil.copytree(OWN_STUDIES, studies, ignore=shutil.ignore_patterns("__pycache__"))
        for case in cases:
            if case.is_shipped:
                text = _git("show", f"{commit}:studies/{case.name}.toml")
                (studies / f"{case.name}.toml").write_text(text, encoding="utf-8")
        for folder in folders:
            folder.mkdir()
        keys = {case.name: _cache_key(case, commit, studies) for case in cases}
        here = Side(ROOT, studies, folders[1])
        kept = {case.name: _cached(arguments.cache, keys[case.name], case) for case in cases}
        missing = [case for case in cases if kept[case.name] is None]
        there = Side(scratch / "worktree", studies, folders[0])
        here.check()
        if missing:
            _git("worktree", "add", "--quiet", "--detach", str(there.checkout), commit)
            stack.callback(_git, "worktree", "remove", "--force", str(there.checkout))
            there.check()
            kept |= _made(there, missing, arguments.jobs, "base")
            for case in missing:
                _cache(arguments.cache, keys[case.name], case, kept[case.name])
        made = _made(here, cases, arguments.jobs, "here")
        if arguments.keep:
            for side, archives in (("base", kept), ("new", made)):
                for name, archive in archives.items():
                    _copied(archive, arguments.keep / side / f"{name}.nc")
        found = {}
        for case in cases:
            name = case.name
            found[name] = compared(flat_archive(Path(str(kept[name]))), flat_archive(made[name]))
            _tell(name, found[name], arguments.lines)
    return found


def _made(side: Side, cases: Iterable[Case], jobs: int, called: str) -> dict[str, Path]:
    """Make the archives of several studies."""

    def make(case: Case) -> tuple[str, Path]:
        start = time.perf_counter()
        archive = side.make(case)
        print(f"{called}: {case.name} in {time.perf_counter() - start:.1f} s", file=sys.stderr)
        return case.name, archive

    with ThreadPoolExecutor(jobs) as pool:
        return dict(pool.map(make, cases))


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True)
    if done.returncode:
        raise YardstickError(f"git {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout


def _cache_key(case: Case, commit: str, studies: Path) -> str:
    """A hash of all that decides an archive: commit, study, processor and packages."""
    digest = hashlib.sha256()
    own = [path for path in sorted(OWN_STUDIES.iterdir()) if path.suffix in (".py", ".csv")]
    files = [studies / f"{case.name}.toml", *([] if case.is_shipped else own)]
    versions = [importlib.metadata.version(name) for name in _PACKAGES]
    told = [commit, *case.command, _processor(), sys.version, *versions]
    for piece in (*(each.encode() for each in told), *(path.read_bytes() for path in files)):
        digest.update(len(piece).to_bytes(8, "little") + piece)
    return digest.hexdigest()[:24]


def _processor() -> str:
    """The kind of processor; last bits depend on the instructions that it knows."""
    information = Path("/proc/cpuinfo")
    if not information.exists():
        return f"{platform.machine()} {platform.processor()}"
    lines = information.read_text(encoding="utf-8", errors="replace").splitlines()
    return "\n".join(
        sorted({line for line in lines if line.startswith(("model name", "flags", "Features"))})
    )


def _cached(cache: Path | None, key: str, case: Case) -> Path | None:
    archive = cache / f"{case.name}-{key}.nc" if cache else None
    return archive if archive and archive.exists() else None


def _cache(cache: Path | None, key: str, case: Case, archive: Path | None) -> None:
    if cache and archive:
        _copied(archive, cache / f"{case.name}-{key}.nc")


def _copied(archive: Path | None, to: Path) -> None:
    """Copy a file so that nobody meets half of it."""
    if archive:
        to.parent.mkdir(parents=True, exist_ok=True)
        part = to.with_name(f"{to.name}.{os.getpid()}.part")
        shutil.copyfile(archive, part)
        part.replace(to)


# Comparing two flat archives


@dataclass(frozen=True)
class Difference:
    """One thing that is not the same on both sides.

    Parameters
    ----------
    sort : str
        Estimates, bounds, runs, statuses, arrays, texts or facts.
    key : Key
        Its place.
    old, new : str
        As they are told.
    """

    sort: str
    key: Key
    old: str
    new: str

    def __str__(self) -> str:
        key = self.key
        place = [each for each in (key.model, key.kind, key.source, key.output, key.name) if each]
        place += [f"{name} = {entry}" for name, entry in key.at]
        what = f" [{key.what}]" if key.what else ""
        return f"{', '.join(place)}{what}: {self.old} → {self.new}"


@dataclass
class Comparison:
    """What is equal, counted by sort, and what differs.

    Parameters
    ----------
    equal : Counter of str
        How many of each sort are equal.
    differences : list of Difference
        All others.
    apart : list of Difference
        Hashes and versions that differ, which is no fault.
    covered : Counter of (str, str)
        How many estimates there are, by kind and statistic.
    """

    equal: Counter[str] = field(default_factory=Counter)
    differences: list[Difference] = field(default_factory=list)
    apart: list[Difference] = field(default_factory=list)
    covered: Counter[tuple[str, str]] = field(default_factory=Counter)

    @property
    def summary(self) -> str:
        """The numbers of what is equal, in words."""
        sorts = ("estimates", "bounds", "runs", "statuses")
        first = ", ".join(f"{self.equal[sort]} {sort}" for sort in sorts)
        others = ", ".join(f"{self.equal[sort]} {sort}" for sort in ("arrays", "texts", "facts"))
        added = f"{self.equal['added']} added as meant"
        points = f"{self.equal['points']} estimates are points of distribution functions"
        return f"{first}; {others} ({points}; {added})"


def compared(old: Flat, new: Flat) -> Comparison:
    """Compare two flat archives.

    Parameters
    ----------
    old, new : Flat
        Of the base and of this checkout.
    """
    comparison = Comparison()
    # Coordinates of a statistic have names of their own.
    had = {key.name for each in (old.estimates, old.texts, old.facts) for key in each}
    estimates = _without_added(new.estimates, had)
    comparison.equal["added"] += len(new.estimates) - len(estimates)
    _compare_estimates(old.estimates, estimates, comparison)
    columns = _without_added(new.columns, had)
    _compare_columns(_renamed(old.columns), columns, new.facts, comparison)
    _compare_texts(_renamed(old.texts), _without_added(new.texts, had), comparison)
    _compare_facts(_renamed(old.facts), _without_added(new.facts, had), comparison)
    return comparison


def _without_added(values: Mapping[Key, Any], had: set[str]) -> dict[Key, Any]:
    """The values of statistics that the base has, or that are not added on purpose."""
    return {
        key: value
        for key, value in values.items()
        if key.name in had or not key.name.startswith(ADDED_STATISTICS)
    }


def _renamed(values: Mapping[Key, Any]) -> dict[Key, Any]:
    """The values of the base, by the names that they have here."""
    if not RENAMED:
        return dict(values)
    renamed = {}
    for key, value in values.items():
        names = RENAMED.get(key.kind, {})
        what, name = names.get(key.what, key.what), names.get(key.name, key.name)
        renamed[key._replace(what=what, name=name)] = value
    return renamed


def _compare_estimates(
    old: Mapping[Key, tuple[float, ...]], new: Mapping[Key, tuple[float, ...]], into: Comparison
) -> None:
    common = [key for key in old if key in new]
    shape = (len(common), len(_BOUNDS))
    one, other = (np.array([each[k] for k in common]).reshape(shape) for each in (old, new))
    for key, equal, (estimate, *bounds) in zip(
        common, (_bits(one) == _bits(other)).tolist(), one.tolist(), strict=True
    ):
        into.covered[key.kind, key.name] += 1
        has = [not np.isnan(each) for each in bounds]
        into.equal["estimates"] += equal[0]
        into.equal["points"] += equal[0] and key.name in _POINTS
        into.equal["bounds"] += sum(e and h for e, h in zip(equal[1:], has, strict=True))
        for number, is_equal in enumerate(equal):
            if not is_equal:
                values = (estimate, *bounds)[number], new[key][number]
                place = key._replace(what=_BOUNDS[number])
                sort = "bounds" if number else "estimates"
                into.differences.append(Difference(sort, place, *_numbers(*values)))
    for key, side in _only_once(old, new):
        told = f"{(old if side == 'old' else new)[key]}"
        into.differences.append(_once("estimates", key, told, side))


def _bits(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Numbers as their bits; one NaN is as good as another."""
    if values.dtype.kind != "f":
        return values
    return np.where(np.isnan(values), np.nan, values).view(f"u{values.dtype.itemsize}")


def _numbers(old: float, new: float) -> tuple[str, str]:
    off = f" (off by {abs(new - old) / abs(old):.1e})" if old and np.isfinite(old + new) else ""
    return repr(old), f"{new!r}{off}"


def _only_once(old: Mapping[Key, Any], new: Mapping[Key, Any]) -> Iterator[tuple[Key, str]]:
    """The keys that only one side has."""
    yield from ((key, "old") for key in old if key not in new)
    yield from ((key, "new") for key in new if key not in old)


def _once(sort: str, key: Key, told: str, side: str) -> Difference:
    """What only one side has."""
    return Difference(sort, key, *((told, "nothing") if side == "old" else ("nothing", told)))


def _compare_columns(
    old: Mapping[Key, npt.NDArray[Any]],
    new: Mapping[Key, npt.NDArray[Any]],
    facts: Mapping[Key, object],
    into: Comparison,
) -> None:
    """Compare arrays; those along runs are told by the run."""
    runs: dict[tuple[str, str], list[npt.NDArray[np.bool_]]] = {}
    for key in (key for key in old if key in new):
        one, other = old[key], new[key]
        is_status = key.name == "status"
        is_of_runs = key.kind == "runs" and facts.get(key._replace(what="dimensions")) == ("run",)
        sort = "arrays" if not is_of_runs else "statuses" if is_status else "runs"
        if one.shape != other.shape or one.dtype.kind != other.dtype.kind:
            shapes = [f"{each.dtype} of shape {each.shape}" for each in (one, other)]
            into.differences.append(Difference(sort, key, *shapes))
            continue
        equal = np.asarray(_bits(one) == _bits(other))
        if is_of_runs:
            runs.setdefault((key.model, key.source), []).append(equal)
        if is_status or not is_of_runs:
            into.equal[sort] += int(equal.sum()) if is_status else bool(equal.all())
        if not equal.all():
            first = int(np.flatnonzero(~equal.ravel())[0])
            values = [each.ravel()[first : first + 1].tolist()[0] for each in (one, other)]
            place = key._replace(at=(("run" if is_of_runs else "place", first),))
            new_value = f"{values[1]!r} ({int((~equal).sum())} of {equal.size} differ)"
            into.differences.append(Difference(sort, place, repr(values[0]), new_value))
    into.equal["runs"] += sum(int(np.all(columns, axis=0).sum()) for columns in runs.values())
    for key, side in _only_once(old, new):
        column = (old if side == "old" else new)[key]
        sort = "runs" if key.kind == "runs" else "arrays"
        into.differences.append(_once(sort, key, f"an array of shape {column.shape}", side))


def _compare_texts(old: Mapping[Key, str], new: Mapping[Key, str], into: Comparison) -> None:
    for key in dict.fromkeys((*old, *new)):
        one, other = old.get(key, ""), new.get(key, "")
        if one == other:
            into.equal["texts"] += 1
        elif key.what not in (GONE if one else ADDED):
            into.differences.append(Difference("texts", key, repr(one), repr(other)))


def _compare_facts(old: Mapping[Key, object], new: Mapping[Key, object], into: Comparison) -> None:
    for key in (key for key in old if key in new):
        if _is_same(old[key], new[key]):
            into.equal["facts"] += 1
        else:
            difference = Difference("facts", key, repr(old[key]), repr(new[key]))
            (into.apart if key.what in APART else into.differences).append(difference)
    for key, side in _only_once(old, new):
        if key.what not in (GONE if side == "old" else ADDED):
            told = repr((old if side == "old" else new)[key])
            difference = _once("facts", key, told, side)
            (into.apart if key.what in APART else into.differences).append(difference)


def _is_same(old: object, new: object) -> bool:
    """Whether two facts are equal: numbers by their bits, a list of one like a single one."""
    one, other = np.ravel(np.asarray(old)), np.ravel(np.asarray(new))
    if one.shape != other.shape or one.dtype.kind != other.dtype.kind:
        return False
    return bool(np.array_equal(_bits(one), _bits(other)))


def _tell(name: str, comparison: Comparison, lines: int) -> None:
    """Print what is equal in a study and what is not."""
    state = "DIFFERENT" if comparison.differences else "equal"
    print(f"{name}: {state}; equal are {comparison.summary}")
    by_sort: dict[str, list[Difference]] = {}
    for each in comparison.differences:
        by_sort.setdefault(each.sort, []).append(each)
    for sort, differences in by_sort.items():
        print(f"  {len(differences)} {sort} differ:")
        for difference in differences[:lines]:
            print(f"    {difference}")
        if len(differences) > lines:
            print(f"    and {len(differences) - lines} more")
    for each in comparison.apart:
        print(f"  no result, but not the same: {_shortened(str(each))}")


def _shortened(text: str, longest: int = 160) -> str:
    return text if len(text) <= longest else f"{text[:longest]}…"


if __name__ == "__main__":
    sys.exit(main())
