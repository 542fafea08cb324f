"""Table of changes of a model that alter its results, with what has to meet each of them.

A row is a name, the files of the study's folder before, the files that replace some of them, and
the text by which the change is met: among the changes that are reported, or, with `NAMED`, among
what was not compared. `RECHECK` is of changes that only a run made again can meet.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["CHANGES", "NAMED", "RECHECK", "Change"]

NAMED, RECHECK = "named: ", ""

SAME_OBJECT = "cannot be distinguished"
OBJECT = "source_sha256 has changed"


class Change(NamedTuple):
    """Two states of a study, and what meets the step from one to the other.

    Names of files are relative to the study's folder; ``$NAME`` is a variable of the environment.
    A study with `program.py` has a function of that program as its model. One that leaves no traces
    in its process needs none of its own.
    """

    name: str
    before: dict[str, str]
    after: dict[str, str]
    met: str
    leaves_traces: bool = True


def _file(name: str, before: str, after: str, met: str = "file m.py has changed") -> Change:
    """Return a change of the model's own file."""
    return Change(name, {"m.py": before}, {"m.py": after}, met)


def _other(
    name: str, source: str, other: str, before: str, after: str, met: str, **more: str
) -> Change:
    """Return a change of something else than the model's file."""
    return Change(name, {"m.py": source, other: before, **more}, {other: after}, met)


def _object(name: str, before: str, after: str, met: str = OBJECT) -> Change:
    """Return a change of a function that is an object of a program."""
    return Change(name, {"program.py": before}, {"program.py": after}, met)


def _number(name: str, program: str, met: str = OBJECT) -> Change:
    """Return a change of each 2 in a program to 3."""
    return _object(name, program, program.replace("2", "3"), met)


def _helper(name: str, source: str, met: str, **more: str) -> Change:
    """Return a change of a helper that lies outside the study's folder."""
    return _other(name, source, "../lib/helper.py", TWO, THREE, met, **more)


def _value(name: str, before: str, after: str, met: str = OBJECT) -> Change:
    """Return a change of a value that a function of a program takes from outside."""
    head, _, before = before.rpartition("; ")
    other, _, after = after.rpartition("; ")
    program = "{head}\nk = {value}\ndef f(x):\n    return {{'y': float(str(k).count('1')) * x}}\n"
    return _object(
        name,
        program.format(head=head, value=before),
        program.format(head=other or head, value=after),
        met,
    )._replace(leaves_traces=False)


def _unknown(name: str, before: str, after: str) -> Change:
    """Return a change of a value whose versions cannot be distinguished."""
    return _value(name, before, after, SAME_OBJECT)


def _study(name: str, before: str, after: str, met: str, **files: str) -> Change:
    """Return a change of the model's table in the study."""
    return Change(name, {"m.py": F, "$model": before, **files}, {"$model": after}, met)


def _command(name: str, other: str, before: str, after: str, met: str, **files: str) -> Change:
    """Return a change of a file of a command, or of its table."""
    kept = {"$model": COMMAND, "run.sh": "#!/bin/sh\necho y = $1\n", **files}
    return Change(name, {**kept, other: before}, {other: after}, met)


COMMAND = """\
command = ["./run.sh", "{x}"]
inputs = { x = "1" }
outputs = { y = "1" }
read = { y = { text = "stdout", pattern = 'y = (\\S+)' } }
"""
OWN_FILE = 'python = "m.py:f"\n'
UNITS = 'inputs = { x = "1" }\noutputs = { y = "1" }\n'
F = "def f(x):\n    return {'y': 2 * x}\n"
G = "def f(x):\n    return {'y': 3 * x}\n"
HELPED = "import helper\ndef f(x):\n    return {'y': helper.k * x}\n"
TWO, THREE = "k = 2\n", "k = 3\n"
PATH = "import sys, pathlib\nsys.path.insert(0, str(pathlib.Path(__file__).parents[1] / 'lib'))\n"
WRAPPING = """\
def d(g):
    @functools.wraps(g)
    def w(x): return {'y': 2 * g(x)['y']}
    return w
"""
HANDLING = """\
def f(x):
    try:
        return {'y': x / 0}
    except ZeroDivisionError:
        return {'y': x}
"""
READING = "import numpy as np\ndef f(x):\n    return {'y': float(CALL) * x}\n"
RUN = "import subprocess, sys, pathlib\nhere = pathlib.Path(__file__).parent\n"
HELPER_FILE = "file ../lib/helper.py has changed"
MOD = "module helper has changed"

CHANGES = [
    # A module that lies outside the study's folder.
    _helper("on a path that the model adds", PATH + HELPED, MOD),
    _helper("on PYTHONPATH", HELPED, MOD, **{"$PYTHONPATH": "../lib"}),
    _helper(
        "in a package that is installed as editable",
        "import site\nsite.addsitedir('../site')\n" + HELPED,
        MOD,
        **{
            "../site/editable.pth": "../lib\n",
            "../site/helper-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: helper\n",
            "../site/helper-1.dist-info/RECORD": "editable.pth,,\n",
        },
    ),
    _helper(
        "loaded by its path",
        "import importlib.util as u, pathlib\n"
        "s = u.spec_from_file_location('h', pathlib.Path(__file__).parents[1] / 'lib/helper.py')\n"
        "helper = u.module_from_spec(s); s.loader.exec_module(helper)\n"
        "def f(x):\n    return {'y': helper.k * x}\n",
        HELPER_FILE,
    ),
    _helper("by runpy", "import runpy\nk = runpy.run_path('../lib/helper.py')['k']\n"
            "def f(x):\n    return {'y': k * x}\n", HELPER_FILE),
    _helper("executed as a text",
            "import pathlib\nexec(pathlib.Path('../lib/helper.py').read_text())\n"
            "def f(x):\n    return {'y': k * x}\n", HELPER_FILE),
    # Other code.
    _other("a shared library", "import ctypes\nlibrary = ctypes.CDLL('../lib/own.so')\n" + F,
           "../lib/own.so", "<library>", "<library>another", "file ../lib/own.so has changed"),
    _other("a module in a zip file", "import sys\nsys.path.insert(0, '../lib/own.zip')\n" + HELPED,
           "../lib/own.zip", "<zip helper.py>k = 2\n", "<zip helper.py>k = 3\n", MOD),
    _other(
        "a script that the model starts",
        RUN + "def f(x):\n"
        "    done = subprocess.run([sys.executable, here / 's.py', str(x)], capture_output=True)\n"
        "    return {'y': float(done.stdout)}\n",
        "s.py",
        "import sys\nprint(2 * float(sys.argv[1]))\n",
        "import sys\nprint(3 * float(sys.argv[1]))\n",
        "file s.py has changed",
    ),
    # Data.
    _other("a file that is opened when the model is loaded",
           "k = float(open('k.txt').read())\ndef f(x):\n    return {'y': k * x}\n", "k.txt", "2",
           "3", "file k.txt has changed"),
    _other("a file that is opened in a run",
           "import json, pathlib\nhere = pathlib.Path(__file__).parent\n"
           "def f(x):\n    return {'y': json.loads((here / 'd/k.json').read_text()) * x}\n",
           "d/k.json", "2", "3", "file d/k.json has changed"),
    _other("a variable of the environment",
           "import os\ndef f(x):\n    return {'y': float(os.environ['K_OF_MODEL']) * x}\n",
           "$K_OF_MODEL", "2", "3", "environment variable K_OF_MODEL has changed"),
    # An import inside a function of a program.
    *(
        Change(
            f"inside a function: {statement}",
            {
                "program.py": f"def f(x):\n    {statement}\n    return {{'y': {value} * x}}\n",
                "helper.py": TWO,
            },
            {"helper.py": THREE},
            met,
        )
        for statement, value, met in (
            ("import helper", "helper.k", OBJECT),
            ("from helper import k", "k", OBJECT),
            (
                "import importlib",
                "importlib.import_module('helper').k",
                "file helper.py has changed",
            ),
        )
    ),
    # A decorator, whose function says that it is another.
    *(
        _object(
            f"a decorator with functools.wraps: {name}",
            f"import functools\n{first}\n{body}",
            f"import functools\n{second}\n{body}",
        )
        for name, first, second, body in (
            (
                "its code",
                WRAPPING,
                WRAPPING.replace("2", "3"),
                "@d\ndef f(x):\n    return {'y': x}\n",
            ),
            (
                "its argument",
                "k = 2\ndef d(k):\n    def e(g):\n        @functools.wraps(g)\n"
                "        def w(x): return {'y': k * g(x)['y']}\n        return w\n    return e",
                "k = 3\ndef d(k):\n    def e(g):\n        @functools.wraps(g)\n"
                "        def w(x): return {'y': k * g(x)['y']}\n        return w\n    return e",
                "@d(k)\ndef f(x):\n    return {'y': x}\n",
            ),
        )
    ),
    # Attributes of functions.
    _number("an attribute of the function", "def f(x):\n    return {'y': f.k * x}\nf.k = 2\n"),
    _number("an attribute of a function that it calls",
            "def g(): return g.k\ng.k = 2\ndef f(x):\n    return {'y': g() * x}\n"),
    _object(
        "an implementation of a single-dispatch function",
        "import functools\n@functools.singledispatch\ndef g(x): return x\n"
        "@g.register\ndef _(x: float): return 2 * x\ndef f(x):\n    return {'y': g(x)}\n",
        "import functools\n@functools.singledispatch\ndef g(x): return x\n"
        "@g.register\ndef _(x: float): return 3 * x\ndef f(x):\n    return {'y': g(x)}\n",
        SAME_OBJECT,
    ),
    # Values whose class is not that which it looks like.
    _unknown("a named tuple with its fields in another order",
             "from collections import namedtuple; namedtuple('T', 'a b')(1, 2)",
             "from collections import namedtuple; namedtuple('T', 'b a')(1, 2)"),
    *(
        _unknown(
            f"a subclass of {kind}",
            f"T = type('T', ({kind},), {{'__str__': lambda s: '1'}}); T({value})",
            f"T = type('T', ({kind},), {{'__str__': lambda s: '11'}}); T({value})",
        )
        for kind, value in (
            ("dict", "a=1"),
            ("list", "[1]"),
            ("float", "1.0"),
            ("tuple", "(1,)"),
            ("str", "'1'"),
        )
    ),
    _unknown("an IntEnum", "import enum; enum.IntEnum('E', {'A': 1, 'B': 2}).A",
             "import enum; enum.IntEnum('E', {'A': 1, 'B': 11}).A"),
    _unknown("a defaultdict", "import collections; collections.defaultdict(lambda: 1, a=1)",
             "import collections; collections.defaultdict(lambda: 11, a=1)"),
    # Arrays.
    _unknown("the mask of an array", "import numpy as np; np.ma.array([1.0, 2.0], mask=[0, 1])",
             "import numpy as np; np.ma.array([1.0, 2.0], mask=[1, 0])"),
    _unknown("a subclass of an array", "import numpy as np; np.matrix([[1.0, 2.0]])",
             "import numpy as np; np.recarray((1, 2), 'f8', b'\\0' * 16)"),
    _value("the order of an array in memory", "import numpy as np; np.ones((2, 3), order='C')",
           "import numpy as np; np.ones((2, 3), order='F')"),
    # Compiled functions.
    _unknown("a bound method of a dict", "{'a': 1}.get", "{'a': 11}.get"),
    _unknown("a bound method of a list", "[1].count", "[11].count"),
    _unknown("a bound item method", "(1,).__getitem__", "(11,).__getitem__"),
    _unknown("a universal function of Python code",
             "import numpy as np; np.frompyfunc(lambda x: 1, 1, 1)",
             "import numpy as np; np.frompyfunc(lambda x: 11, 1, 1)"),
    # Code that looks alike.
    _number("a lambda in a lambda", "f = lambda x: (lambda z: {'y': 2 * z})(x)\n"),
    _object("two lambdas on a line", "g, f = [lambda x: {'y': 2 * x}, lambda x: {'y': 3 * x}]\n",
            "f, g = [lambda x: {'y': 2 * x}, lambda x: {'y': 3 * x}]\n"),
    _object("code that was replaced", F + "def g(x):\n    return {'y': 3 * x}\n",
            F + "def g(x):\n    return {'y': 3 * x}\nf.__code__ = g.__code__\n"),
    # Names that no code states, and libraries that were changed.
    _number("globals()", "k = 2\ndef f(x):\n    return {'y': globals()['k'] * x}\n", SAME_OBJECT),
    _number("eval", "k = 2\ndef f(x):\n    return {'y': eval('k * x')}\n", SAME_OBJECT),
    *(
        _object(
            f"{library} is changed by the program",
            f"import {library}\ndef f(x):\n    return {{'y': {library}.{name} * x}}\n",
            f"import {library}\n{library}.{name} = 3.0\n"
            f"def f(x):\n    return {{'y': {library}.{name} * x}}\n",
            RECHECK,
        )
        for library, name in (("math", "pi"), ("numpy", "pi"), ("scipy.constants", "g"))
    ),
    # The state of a library.
    _object("the precision of decimal",
            "import decimal\ndef f(x):\n    return {'y': float(decimal.Decimal(1) / 3)}\n",
            "import decimal\ndecimal.getcontext().prec = 3\n"
            "def f(x):\n    return {'y': float(decimal.Decimal(1) / 3)}\n", RECHECK),
    _object("the seed of numpy.random", "import numpy\nnumpy.random.seed(1)\n"
            "def f(x):\n    return {'y': numpy.random.random() * x}\n",
            "import numpy\nnumpy.random.seed(2)\n"
            "def f(x):\n    return {'y': numpy.random.random() * x}\n", RECHECK),
    *(
        Change(
            f"a table that a program reads by {call}",
            {"program.py": READING.replace("CALL", call), "k.csv": "2"},
            {"k.csv": "3"},
            "file k.csv has changed",
        )
        for call in (
            "np.loadtxt('k.csv')",
            "np.genfromtxt('k.csv')",
            "np.memmap('k.csv', 'u1', 'r')[0]",
        )
    ),
    # What programs start by themselves.
    _other(
        "what a program starts",
        RUN + "def f(x):\n"
        "    done = subprocess.run([here / 'wrapper.sh', str(x)], capture_output=True)\n"
        "    return {'y': float(done.stdout)}\n",
        "../lib/solver.sh",
        "#!/bin/sh\necho 2\n",
        "#!/bin/sh\necho 3\n",
        NAMED + "what wrapper.sh reads and starts",
        **{"wrapper.sh": '#!/bin/sh\nexec "$(dirname "$0")/../lib/solver.sh" "$1"\n'},
    ),
    _other(
        "what a script imports",
        RUN + "def f(x):\n"
        "    done = subprocess.run([sys.executable, here / 's.py', str(x)], capture_output=True)\n"
        "    return {'y': float(done.stdout)}\n",
        "own.py",
        TWO,
        THREE,
        NAMED + "what s.py reads and starts",
        **{"s.py": "import sys, own\nprint(own.k * float(sys.argv[1]))\n"},
    ),
    _other(
        "what a shell finds",
        RUN + "import os\ndef f(x):\n"
        "    done = subprocess.run('\"$PLACE/p.sh\"', shell=True, capture_output=True,\n"
        "                          env={'PLACE': str(here.parent / 'lib')})\n"
        "    return {'y': float(done.stdout)}\n",
        "../lib/p.sh",
        "#!/bin/sh\necho 2\n",
        "#!/bin/sh\necho 3\n",
        NAMED + "what p.sh reads and starts",
    ),
]  # fmt: skip

PACKAGED = "from p.q import k\n" + F.replace("2", "k")
SIN = "import numpy as np\ndef f(x):\n    return {'y': np.sin(x)}\n"
CLASS = """\
from uqpen.core.model import Input, Model, Output, Results
class Own(Model):
    name = "own"
    inputs = (Input("x", "1"),)
    outputs = (Output("y", "1"),)
    def evaluate(self, inputs):
        return Results.all_ok({"y": 2 * inputs["x"]})
"""

CHANGES += [
    # The model's own file.
    _file("a constant in the function", F, G),
    _file("the operator", F, F.replace("*", "+")),
    _file("a global constant", "k = 2\n" + F.replace("2", "k"), "k = 3\n" + F.replace("2", "k")),
    _file("a default", F.replace("(x)", "(x, k=2)"), F.replace("(x)", "(x, k=3)")),
    _file("the called library function", SIN, SIN.replace("sin", "cos")),
    _file("another definition of the name", F, F + G),
    _file(
        "a decorator of its own file",
        "def d(g): return g\n@d\n" + F,
        "def d(g): return lambda x: {'y': x}\n@d\n" + F,
    ),
    _file("an own class", CLASS, CLASS.replace("2 *", "3 *")),
    *(
        Change(name, {"m.py": source, file: TWO, **more}, {file: THREE}, f"file {file} has changed")
        for name, source, file, more in (
            ("a module beside it", HELPED, "helper.py", {}),
            ("a module of a module", HELPED, "other.py", {"helper.py": "from other import k\n"}),
            ("a package beside it", PACKAGED, "p/q.py", {"p/__init__.py": ""}),
            ("a namespace package beside it", PACKAGED, "p/q.py", {}),
            (
                "a module that only a run imports",
                "def f(x):\n    import helper\n    return {'y': helper.k * x}\n",
                "helper.py",
                {},
            ),
        )
    ),
    Change(
        "a module that is not there any more",
        {
            "m.py": "try:\n    from helper import k\nexcept ImportError:\n    k = 3\n"
            + F.replace("2", "k"),
            "helper.py": TWO,
        },
        {"helper.py": ""},
        "file helper.py",
    ),
    Change(
        "a module in another place of the same name",
        {"m.py": PATH.replace("insert(0, ", "append(") + HELPED, "../lib/helper.py": TWO},
        {"helper.py": THREE},
        "module helper",
    ),
    # The table of the study.
    _study(
        "another function",
        OWN_FILE + UNITS,
        OWN_FILE.replace("f", "g") + UNITS,
        "model.python",
        **{"m.py": F + "g = lambda x: {'y': 3 * x}\n"},
    ),
    *(
        _study(name, OWN_FILE + UNITS, OWN_FILE + after, met)
        for name, after, met in (
            ("the unit of an input", UNITS.replace('x = "1"', 'x = "percent"'), "model.inputs.x"),
            ("the unit of an output", UNITS.replace('y = "1"', 'y = "percent"'), "model.outputs.y"),
            ("whole batches", f"vectorized = true\n{UNITS}", "model.vectorized"),
        )
    ),
    _study("another built-in model", 'use = "ishigami"', 'use = "ishigami"\na = 5.0', "a was"),
    # Commands.
    _command(
        "the program",
        "run.sh",
        "#!/bin/sh\necho y = 2\n",
        "#!/bin/sh\necho y = 3\n",
        "file run.sh has changed",
    ),
    _command(
        "a word of the command",
        "$model",
        COMMAND,
        COMMAND.replace('"{x}"', '"{x}", "3"'),
        "model.command",
    ),
    _command(
        "the reading of an output", "$model", COMMAND, COMMAND.replace("y = (", "= ("), "model.read"
    ),
    _command(
        "a template",
        "case.in",
        "x = {x}\n",
        "x = {x}0\n",
        "file case.in has changed",
        **{"$model": COMMAND + 'templates = { "run.in" = "case.in" }\n'},
    ),
    _command(
        "a file of the command",
        "k.txt",
        "2",
        "3",
        "file k.txt has changed",
        **{"$model": COMMAND.replace('"{x}"', '"{x}", "k.txt"')},
    ),
    # Values that a function of a program takes from outside.
    *(
        _value(f"a value: {before} to {after}", before, after)
        for before, after in (
            ("1", "2"),
            ("1", "1.0"),
            ("True", "1"),
            ("None", "0"),
            ("0.0", "-0.0"),
            ("1.0", "1.0000000000000002"),
            ("complex(1, 0.0)", "complex(1, -0.0)"),
            ("'1'", "b'1'"),
            ("[1, 2]", "[2, 1]"),
            ("[1]", "(1,)"),
            ("(1, (2, 3))", "(1, 2, 3)"),
            ("{'a': 1}", "{'a': 2}"),
            ("{'a': 1, 'b': 2}", "{'b': 2, 'a': 1}"),
            ("{1, 2}", "{1, 3}"),
            ("frozenset({1})", "{1}"),
            ("range(3)", "range(4)"),
            ("[[1], [2]]", "[[1, 2], []]"),
            ("import numpy as np; np.arange(3.0)", "import numpy as np; np.arange(4.0)"),
            ("import numpy as np; np.ones(2)", "import numpy as np; np.ones(2, 'f4')"),
            ("import numpy as np; np.ones((2, 3))", "import numpy as np; np.ones((3, 2))"),
            ("import numpy as np; np.float64(1)", "import numpy as np; np.float32(1)"),
            ("import numpy as np; np.sin", "import numpy as np; np.cos"),
            ("import math; math.sin", "import math; math.cos"),
            ("min", "max"),
            ("int", "float"),
            ("import math, cmath; math", "import math, cmath; cmath"),
            (
                "from functools import partial; partial(pow, 2)",
                "from functools import partial; partial(pow, 3)",
            ),
            ("lambda: 1", "lambda: 2"),
        )
    ),
    # Its code.
    _object("its constant", F, G),
    _object(
        "its keyword default", F.replace("(x)", "(x, *, k=2)"), F.replace("(x)", "(x, *, k=3)")
    ),
    _number(
        "a variable of the function around it",
        "def o(k):\n    def f(x): return {'y': k * x}\n    return f\nf = o(2)\n",
    ),
    _number("a function that it calls", "def g(x): return 2 * x\ndef f(x): return {'y': g(x)}\n"),
    _number("a comprehension", "def f(x): return {'y': sum(2 * x for _ in range(3))}\n"),
    _object("its handling of an error", HANDLING, HANDLING.replace("ZeroDivision", "Arithmetic")),
    _number(
        "an object of an own class",
        "class S:\n    def __call__(self, x): return {'y': 2 * x}\nf = S()\n",
        SAME_OBJECT,
    ),
    _number(
        "a method of an own object",
        "class S:\n    def f(self, x): return {'y': 2 * x}\nf = S().f\n",
        SAME_OBJECT,
    ),
]
