"""Names are the field's words: see ``docs/glossary.md``."""

import ast
import importlib
import re
from collections import Counter
from functools import cache
from itertools import chain
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "uqpen"
MODULES = sorted(PACKAGE.rglob("*.py"))

# What the code said before it spoke the field's language, and what it says now. Parts of a name, as
# split at underscores and capitals, are held against these as a whole.
RETIRED = {
    "told|tell|tells|said|unsaid|spoken": "estimate, interval text, note, message, text",
    "asked|asks?|questions?": "requested, quantity of interest; request (over HTTP)",
    "laws?": "joint distribution (of the inputs), distribution (of one input)",
    "holds?|held": "tolerance limit; contains; fixed",
    "witness|witnesses|judged?|gate|vouch\\w*|unvouched": "validation runs, surrogate validation",
    "reach|reaches": "training range",
    "lost|loss|losses|back": "failed, missing; completed",
    "nearby": "nearest neighbours, local regression",
    "germs?": "univariate basis",
    "decisive": "fingerprint",
    "keepers?|pieces?": "checkpoint, batch result, chunk",
    "foreign|supervis\\w*": "untrusted, external; limits, child process",
    "gap|apart|explain": "relative difference, disjoint, diff",
    "disorder|misfit|obstacle|objection": "check_settings, check_inputs, problem",
    "plan": "error model",
    "courses?": "trajectory, history",
    "contests?|bench": "benchmark, comparison, verdict",
    "figures": "estimates; a figure is a picture",
    "called|beside": "name, label, prefix; companion",
    "kinds": "categories",
    "whose|which|what|who|why|how|where": "a noun or a verb",
    "doubts?|silent|nobody": "warning, note",
    "answers": "estimates, statistics",
}
# Names that keep such a word.
ALLOWED = {
    "figures": "the package that draws pictures",
    "plan": "the command `uqpen plan`",
    "course": "rod_course enters the hash of the built-in models' source",
}

# Words that a docstring does not use in the sense that they had here.
RETIRED_IN_DOCSTRINGS = {
    r"\btold\b|\btells?\b": "gives, reports, states, says",
    r"\blaws?\b": "distribution, joint distribution",
    r"\bquestions?\b": "quantity of interest, request",
    r"\bwitness(es)?\b|\bvouch(es|ed)?\b|\bbear(s|ing)? out\b": "validation runs, confirm",
    r"\bgerms?\b": "univariate basis",
    r"\b(came|come|comes|coming) back\b": "completed",
    r"\b(was|were|is|are) lost\b|\blost runs?\b": "failed, missing",
    r"\bheld against\b": "compared with",
    r"\bhead to head\b": "benchmark of methods",
    r"\bso many\b|\bof which\b": "a number; a noun and a verb",
}


def parts_of(name):
    words = name.split("_")
    found = (re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z0-9]+", word) for word in words)
    return [part.lower() for word in found for part in word]


@cache
def parsed(module):
    return ast.parse(module.read_text(encoding="utf-8"))


@cache
def definitions(module):
    """The functions and classes of a module; expressions, most of its nodes, contain none."""
    waiting, found = [parsed(module)], []
    while waiting:
        node = waiting.pop()
        found += [node] if isinstance(node, (ast.FunctionDef, ast.ClassDef)) else []
        for part in ("body", "orelse", "handlers", "finalbody", "cases"):
            inner = getattr(node, part, None)
            waiting += inner if isinstance(inner, list) else []
    return found


@cache
def instead_of(part):
    """What to say for a part of a name, which many names share."""
    found = (instead for words, instead in RETIRED.items() if re.fullmatch(words, part))
    return () if part in ALLOWED else tuple(found)


def retired_in(name):
    return [
        f"{name}: {part} (say: {instead})"
        for part in parts_of(name)
        for instead in instead_of(part)
    ]


def test_names_are_the_fields_words():
    found = []
    for module in MODULES:
        names = [module.stem, *(node.name for node in definitions(module))]
        faults = [fault for name in names for fault in retired_in(name)]
        found += [f"{module.relative_to(PACKAGE)}: {fault}" for fault in faults]
    assert found == []


def test_docstrings_use_the_fields_words():
    found = []
    for module in MODULES:
        for node in [parsed(module), *definitions(module)]:
            text = ast.get_docstring(node) or ""
            for words, instead in RETIRED_IN_DOCSTRINGS.items():
                if match := re.search(words, text, re.IGNORECASE):
                    where = f"{module.relative_to(PACKAGE)}, {getattr(node, 'name', 'module')}"
                    found.append(f"{where}: {match[0]} (say: {instead})")
    assert found == []


def test_a_public_class_has_a_name_of_its_own():
    classes = [node for module in MODULES for node in definitions(module)]
    names = Counter(node.name for node in classes if isinstance(node, ast.ClassDef))
    assert [name for name, count in names.items() if count > 1 and not name.startswith("_")] == []


def test_a_module_gives_a_name_one_value():
    found = []
    for module in MODULES:
        nodes = (node for node in parsed(module).body if isinstance(node, ast.Assign))
        assigned = (ast.unparse(node.targets[0]).strip("()").split(", ") for node in nodes)
        names = Counter(chain.from_iterable(assigned))
        found += [f"{module.name}: {name}" for name, count in names.items() if count > 1]
    assert found == []


def test_a_file_name_stands_for_two_modules_at_most():
    names = Counter(module.name for module in MODULES if module.name != "__init__.py")
    assert [name for name, count in names.items() if count > 2] == []


def glossary_references():
    text = (PACKAGE.parent / "docs" / "glossary.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in text.splitlines() if line.count(" | ") >= 4]
    found = (re.findall(r"`([a-z_]+(?:\.\w+)+)`", row[3]) for row in rows)
    return sorted({reference for references in found for reference in references})


def resolved(reference):
    """What a reference of the glossary stands for: a module, or something in one."""
    words = f"uqpen.{reference}".split(".")
    for end in range(len(words), 0, -1):
        try:
            found = importlib.import_module(".".join(words[:end]))
        except ModuleNotFoundError:
            continue
        for name in words[end:]:
            fields = getattr(found, "__dataclass_fields__", {})
            found = fields[name] if name in fields else getattr(found, name)
        return found
    raise ModuleNotFoundError(reference)


def test_the_glossary_names_what_there_is():
    missing = []
    for reference in glossary_references():
        try:
            resolved(reference)
        except (AttributeError, ModuleNotFoundError) as error:
            missing.append(f"{reference}: {error}")
    assert missing == []
