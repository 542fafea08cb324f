"""Models on a UM-Bridge server: the real one, and some that misbehave."""

import contextlib
import re
import socket
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from model_servers import LISTENING

import uqpen
from uqpen.core.errors import StudyError
from uqpen.core.status import Status
from uqpen.execution.processes import processes
from uqpen.models import umbridge
from uqpen.study import umbridge_section

pytestmark = pytest.mark.slow

SERVER = Path(__file__).parents[1] / "umbridge_server.py"
DOCUMENT = Path(__file__).parents[2] / "docs" / "models.md"

STUDY = """\
seed = 1
[model]
umbridge = "{address}"
{model}
[model.inputs]
a = "cm"
b = "m"
c = "degC"
[model.outputs]
y = "m"
z = "mm"
[inputs]
a = {{ uniform = {{ lower = "0 cm", upper = "1 cm" }} }}
b = {{ uniform = {{ lower = "0 m", upper = "1 m" }} }}
c = "20 degC"
[designs.some]
kind = "monte-carlo"
runs = 20
"""


@contextlib.contextmanager
def serving(models=2, program=SERVER):
    """The address of a real server, and its process."""
    command = [sys.executable, str(program), str(models)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        try:
            yield f"http://127.0.0.1:{process.stdout.readline().strip()}", process
        finally:
            process.kill()


@pytest.fixture(scope="module")
def address():
    with serving() as (address, _):
        yield address


def _receive(connection):
    """Read a whole request: a connection that is closed before may take its answer along."""
    with connection.makefile("rb") as request:
        length = 0
        while line := request.readline().strip():
            if line.lower().startswith(b"content-length:"):
                length = int(line.partition(b":")[2])
        request.read(length)


@contextlib.contextmanager
def answering(*answers, drip=None):
    """The address of a server that gives these answers, a connection each, whatever is asked.

    It may give one more drop by drop: what it begins with, what is repeated, and what it ends with.
    The drops end some ten seconds later, for a client that waits until then, or when it leaves.
    """
    listening = socket.create_server(("127.0.0.1", 0))
    is_over = threading.Event()

    def serve():
        for answer in answers:
            connection, _ = listening.accept()
            with connection:
                _receive(connection)
                connection.sendall(answer)
        if drip is None:
            return
        start, drop, end = drip
        connection, _ = listening.accept()
        with connection, contextlib.suppress(OSError):
            connection.recv(65536)
            connection.sendall(start)
            for _ in range(100):
                if is_over.wait(0.1):
                    return
                connection.sendall(drop)
            connection.sendall(end)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    with listening:
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        is_over.set()
        thread.join(5 if drip is None else 60)


def http(content, code="200 OK"):
    head = f"HTTP/1.1 {code}\r\nContent-Length: {len(content.encode())}\r\nConnection: close"
    return f"{head}\r\n\r\n{content}".encode()


# For a server of this file, which answers one run: none is made again.
ANSWERED_ONCE = "noise = false\n"

# What a server says of itself before the first run.
BEFORE = (
    http('{"protocolVersion": 1.0, "models": ["sum"]}'),
    http('{"support": {"Evaluate": true}}'),
    http('{"inputSizes": [3]}'),
    http('{"outputSizes": [1, 1]}'),
)


def study(address, model='name = "sum"', *changes):
    text = STUDY.format(address=address, model=model)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return uqpen.parse_study(text)


def refused(*arguments):
    """The mistake for which a study is refused."""
    with pytest.raises(StudyError) as caught:
        study(*arguments)
    (problem,) = caught.value.problems
    return problem


def runs(study):
    return uqpen.run(study)["runs/some"]


class TestRuns:
    def test_vectors_are_filled_in_order_and_in_the_units_that_are_declared(self, address):
        made = runs(study(address))
        a, b = made["a"].values / 0.01, made["b"].values
        assert (made["status"] == Status.OK).all()
        # The server is sent centimetres, metres and degrees, and answers metres and millimetres.
        np.testing.assert_array_equal(made["y"], 100.0 * (a + b) + 20.0)
        np.testing.assert_array_equal(made["z"], a * 0.001)

    def test_config_is_handed_over(self, address):
        made = runs(study(address, 'name = "sum"\nconfig = { factor = 0.0 }'))
        assert set(made["y"].values) == {20.0}

    def test_what_decides_the_numbers_is_reported(self, address):
        model = study(address, 'name = "sum"\nconfig = { b = [1], a = "x" }').model
        assert model.identity() == {
            "name": "sum",
            "kind": "UM-Bridge",
            "config": '{"a": "x", "b": [1]}',
        }
        elsewhere = study(address.replace("127.0.0.1", "localhost")).model
        assert elsewhere.identity() == study(address).model.identity()

    @pytest.mark.parametrize("model", ["sum", "sum and failures"])
    def test_two_workers_give_the_same_bytes_as_none(self, address, model):
        config = "" if model == "sum" else '\nconfig = { limit = 0.7, beyond = "short" }'
        loaded = study(address, 'name = "sum"' + config)
        alone = uqpen.run(loaded)
        with processes(2) as pool:
            assert uqpen.run(loaded, map=pool).identical(alone)


INVALID = "InvalidOutput: Number of output vectors returned by model does not match number of "

LOST = "the server cannot be reached, or has closed the connection"
NO_OBJECT = "the server's answer is no JSON object"
NO_VECTORS = "the server's output is not made of vectors of length 1, 1"
ANSWERS = {
    "null": (http('{"output": [[1], [null]]}'), "z is nan"),
    "NaN": (http('{"output": [[NaN], [2]]}'), "y is nan"),
    "infinite": (http('{"output": [[-inf], [2]]}'), "y is -inf"),
    "huge": (http(f'{{"output": [[1{400 * "0"}], [2]]}}'), "y is inf"),
    "text": (http('{"output": [[1], ["2"]]}'), 'the server\'s output has "2", not a number'),
    "flag": (http('{"output": [[true], [2]]}'), "the server's output has true, not a number"),
    "list": (http('{"output": [[[1]], [2]]}'), "the server's output has [1], not a number"),
    "no vectors": (http('{"output": [1, 2]}'), NO_VECTORS),
    "nothing": (http("{}"), NO_VECTORS),
    "no object": (http("[1]"), NO_OBJECT),
    "deep": (http("[" * 100_000), NO_OBJECT),
    "elsewhere": (http("", "302 Found"), f"{NO_OBJECT} (HTTP 302 Found)"),
    "no HTTP": (b"nonsense\r\n\r\n", "the server's answer is not HTTP"),
    "silence": (b"", LOST),
    "half": (b"HTTP/1.1 200 OK\r\nContent-Length: 50\r\n\r\n{", LOST),
    "error": (http('{"error": {"type": "Broken", "message": "at\\n x"}}'), "Broken: at x"),
    "places": (http('{"error": {"type": "A", "message": "http://host:1/b, <M at 0x7f12>"}}'),
               "A: … <M at …>"),
    "bare error": (http('{"error": "out of order"}'),
                   "the server answers with an error: out of order"),
    "chunk of negative size": (
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n-5\r\nhello\r\n0\r\n\r\n",
        "the server's answer is not HTTP"),
    "chunk without an end": (
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n-1\r\nhello\r\n0\r\n\r\n",
        LOST,
    ),
    "long": (http(f'{{"error": {{"message": "{500 * "m"}"}}}}'), f"error: {192 * 'm'}…"),
}  # fmt: skip

HEAD = b"HTTP/1.1 200 OK\r\n"
RUN = b'{"output": [[1], [2]]}'
# A valid answer that takes far longer than the limit, though each of its pieces comes soon: what it
# begins with, what is repeated, and what it ends with.
DRIPS = {
    "content": (HEAD + b"Content-Length: 122\r\n\r\n", b" ", RUN),
    "chunks": (HEAD + b"Transfer-Encoding: chunked\r\n\r\n", b"1\r\n \r\n",
               b"16\r\n" + RUN + b"\r\n0\r\n\r\n"),
    "a header": (HEAD + b"X-Long: ", b"x", b"\r\nContent-Length: 22\r\n\r\n" + RUN),
    "continue": (b"", b"HTTP/1.1 100 Continue\r\n\r\n", http(RUN.decode())),
}  # fmt: skip


class TestLostRuns:
    @pytest.mark.parametrize(
        ("beyond", "status", "reason"),
        [
            ("short", Status.FAILED, f"{INVALID}model outputs declared by model!"),
            ("raise", Status.FAILED,
             "the server's answer is no JSON object (HTTP 500 Internal Server Error)"),
            ("nan", Status.NOT_FINITE, "y is nan"),
            ("inf", Status.NOT_FINITE, "z is -inf"),
        ],
    )  # fmt: skip
    def test_of_the_real_server(self, address, beyond, status, reason):
        made = runs(study(address, f'config = {{ limit = 0.7, beyond = "{beyond}" }}\nname="sum"'))
        lost = made["a"].values / 0.01 > 0.7
        assert 0 < lost.sum() < 20
        np.testing.assert_array_equal(made["status"], np.where(lost, status, Status.OK))
        assert set(made["lost_reason"].values) == {reason}

    def test_a_run_beyond_the_time_limit(self, address):
        model = f'{ANSWERED_ONCE}name = "sum"\ntime_limit = "1 s"\n'
        model += 'config = { limit = 0.93, beyond = "sleep" }'
        made = runs(study(address, model))
        assert set(made["status"].values) == {Status.OK, Status.TIMED_OUT}
        assert set(made["lost_reason"].values) == {"took longer than 1 s"}

    @pytest.mark.parametrize("case", DRIPS)
    def test_the_time_limit_is_that_of_the_whole_answer(self, case):
        with answering(*BEFORE, drip=DRIPS[case]) as address:
            limited = study(
                address, f'{ANSWERED_ONCE}time_limit = "0.3 s"', ("runs = 20", "runs = 1")
            )
            made = runs(limited)
        assert made["status"].values.tolist() == [Status.TIMED_OUT]
        assert made["lost_reason"].values.tolist() == ["took longer than 0.3 s"]

    def test_what_never_ends_is_not_received_for_ever(self, monkeypatch):
        monkeypatch.setattr(umbridge, "_MOST_RECEIVED", 2**17)
        endless = 10_000 * b"HTTP/1.1 100 Continue\r\n\r\n"
        with answering(*BEFORE, drip=(endless, b"H", b"")) as address:
            made = runs(study(address, ANSWERED_ONCE, ("runs = 20", "runs = 1")))
        reported = "the server's answer has more than 16777216 bytes"
        assert made["lost_reason"].values.tolist() == [reported]

    def test_the_size_of_an_answer_is_limited(self, monkeypatch):
        monkeypatch.setattr(umbridge, "_LARGEST", 1000)
        answers = (http('{"output": [[1], [2]]}'.ljust(size)) for size in (1000, 1001))
        with answering(*BEFORE, *answers) as address:
            points = {name: np.array([0.1, 0.2]) for name in ("a", "b", "c")}
            results = study(address, "").model.evaluate(points)
        assert results.reasons == {1: "the server's answer has more than 16777216 bytes"}

    def test_a_server_that_dies_takes_the_rest_of_the_study_along_at_once(self):
        with serving() as (address, process):
            loaded = study(
                address,
                'name = "sum"\nconfig = { limit = 0.7, beyond = "die" }',
                ("runs = 20", "runs = 2000\n[failures]\nstop_after = 0"),
            )
            made = runs(loaded)
            process.wait(60)
        first = int(np.argmax(made["a"].values / 0.01 > 0.7))
        np.testing.assert_array_equal(made["status"].values[:first], Status.OK)
        np.testing.assert_array_equal(made["status"].values[first:], Status.FAILED)
        assert set(made["lost_reason"].values) == {LOST}

    @pytest.mark.parametrize(("seconds", "tries"), [(0.1, 2), (5.0, 1)])
    def test_a_host_that_does_not_even_refuse_keeps_only_one_run_waiting(
        self, seconds, tries, monkeypatch
    ):
        clock = [0.0]

        def connect(connection):
            clock.append(clock[-1] + seconds)
            raise TimeoutError

        monkeypatch.setattr("http.client.HTTPConnection.connect", connect)
        monkeypatch.setattr(umbridge, "time", SimpleNamespace(monotonic=lambda: clock[-1]))
        client = umbridge.UmbridgeClient(umbridge.Address("localhost", 1))
        for _ in range(2):
            with pytest.raises(umbridge.NoAnswerError, match=LOST):
                client.request("Info")
        assert len(clock) == 1 + tries

    @pytest.mark.parametrize("case", ANSWERS)
    def test_of_servers_that_misbehave(self, case):
        answer, reason = ANSWERS[case]
        with answering(*BEFORE, answer) as address:
            made = runs(study(address, ANSWERED_ONCE, ("runs = 20", "runs = 1")))
        assert made["lost_reason"].values.tolist() == [reason]

    def test_a_server_that_gives_up_a_connection_is_asked_again(self):
        whole = http('{"output": [[1], [2]]}').replace(b"\r\nConnection: close", b"")
        with answering(*BEFORE, whole, whole) as address:
            loaded = study(address, "")
            points = {name: np.array([0.1, 0.2]) for name in ("a", "b", "c")}
            results = loaded.model.evaluate(points)
        assert results.status.tolist() == [Status.OK, Status.OK]


ADDRESS = 'the address of a UM-Bridge server, such as "http://127.0.0.1:4242"'
NAME = 'name = "sum"'
MODEL = 'a model of this server; did you mean "sum"? known: sum, idle'
VALUE = "a text, a number, true or false, or lists or tables of them"
KEYS = (
    "noise, seed, umbridge, name, time_limit, config, inputs, outputs, labels, dimensions, outcomes"
)
LIMIT = "5  model.time_limit"


def also(line):
    """A line more, after the name."""
    return [(NAME, f"{NAME}\n{line}")]


# What a study has in place of what, and where which message stands.
MISTAKES = [
    ([(NAME, 'name = "summ"')], "4  model.name", '"summ"', MODEL),
    ([(NAME, "")], "2  model.name", "nothing", "a model of this server; known: sum, idle"),
    ([(NAME, 'name = "idle"')], "3  model.umbridge", '"idle", which does not support Evaluate',
     "a model that can run"),
    ([('c = "degC"\n', ""), ('c = "20 degC"\n', "")], "5  model.inputs", "2 inputs",
     'as many as "sum" takes numbers: 3 (2 + 1)'),
    ([('z = "mm"\n', 'z = "mm"\nw = "1"\n')], "9  model.outputs", "3 outputs",
     'as many as "sum" gives numbers: 2 (1 + 1)'),
    (also("time_limit = 10"), LIMIT, '"10", a number without a unit', 'a time, such as "10 s"'),
    (also('time_limit = "0 s"'), LIMIT, '"0 s"', 'a time such as "10 s" or "5 min"'),
    (also("config = { at = 2020-01-01 }"), "5  model.config.at", "2020-01-01", VALUE),
    (also("config = { at = { in = [1, inf] } }"), "5  model.config.at", "inf", VALUE),
    (also('nmae = "sum"'), "5  model.nmae", "an unknown key",
     f'did you mean "name"? known: {KEYS}'),
]  # fmt: skip


class TestMistakes:
    @pytest.mark.parametrize(("changes", "where", "found", "expected"), MISTAKES)
    def test_in_a_study(self, address, changes, where, found, expected):
        with pytest.raises(StudyError) as caught:
            study(address, NAME, *changes)
        block = f"  study.toml:{where}\n    found     {found}\n    expected  {expected}"
        assert str(caught.value) == f"study.toml: 1 mistake; nothing was run\n\n{block}"

    @pytest.mark.parametrize(
        "address",
        [
            "127.0.0.1:4242",
            "ftp://127.0.0.1",
            "http://",
            "http://127.0.0.1:port",
            "http://me:secret@127.0.0.1",
            "http://127.0.0.1/?a=b",
            "http://127.0.0.1/ a",
            f"http://{'a' * 70}.org",
        ],
    )
    def test_what_is_no_address(self, address):
        problem = refused(address)
        assert (problem.found, problem.expected) == (f'"{address}"', ADDRESS)

    def test_where_nobody_listens(self):
        with socket.create_server(("127.0.0.1", 0)) as listening:
            address = f"http://127.0.0.1:{listening.getsockname()[1]}"
        problem = refused(address)
        assert problem.found == f'"{address}": {LOST}'
        assert problem.expected == "a UM-Bridge server that responds"

    def test_a_server_that_never_finishes_an_answer_holds_no_check(self, monkeypatch):
        monkeypatch.setattr(umbridge_section, "_PATIENCE", 0.5)
        with answering(drip=DRIPS["content"]) as address:
            problem = refused(address)
        assert problem.found == f'"{address}": took longer than 0.5 s'

    @pytest.mark.parametrize(
        ("answers", "found", "expected"),
        [
            ([http('{"protocolVersion": 2.0, "models": ["sum"]}')],
             "a server of protocol version 2.0", "version 1.0"),
            ([http("{}")], "a server of protocol version None", "version 1.0"),
            ([http('{"protocolVersion": 1.0}')], "nothing",
             "a model of this server; none is known"),
            ([http("<html>")], '"{}": the server\'s answer is no JSON object',
             "a UM-Bridge server that responds"),
            ([*BEFORE[:2], http('{"inputSizes": [-1, 4]}')],
             '"{}": the server\'s answer to InputSizes is no list of whole numbers',
             "a UM-Bridge server that responds"),
        ],
    )  # fmt: skip
    def test_with_a_server(self, answers, found, expected):
        with answering(*answers) as address:
            problem = refused(address, "")
        assert (problem.found, problem.expected) == (found.format(address), expected)


def test_a_model_that_is_not_trusted_has_no_runs():
    text = STUDY.format(address="http://127.0.0.1:1", model='name = "sum"')
    model = uqpen.parse_study(text, trust=False).model
    results = model.evaluate({name: np.array([0.1]) for name in ("a", "b", "c")})
    assert results.reasons == {0: "sum: the server is not asked without --trust"}


def test_an_archive_that_is_not_trusted_asks_no_server(command_line, tmp_path):
    with serving(1) as (address, _):
        loaded = study(address, "")
        assert loaded.model.name == "sum"
        uqpen.write(uqpen.run(loaded), tmp_path / "study.nc")
        trusted = command_line("verify", "study.nc", "--trust")
    assert trusted.code == 0, trusted.out
    assert "runs 20 of 20 repeated: bit-equal" in trusted.said
    # Now nobody listens any more.
    done = command_line("verify", "study.nc")
    assert done.code == 0, done.out
    assert f"they execute code that the archive names ({address})" in done.said
    assert "groups computed again: bit-equal" in done.said
    refused = command_line("rerun", "study.nc", "-o", "again.nc")
    assert refused.code == 2
    assert f"its study executes code that it names: {address}" in refused.err


def test_the_documented_example_runs_and_is_right(tmp_path):
    text = DOCUMENT.read_text(encoding="utf-8").partition("## A server: `umbridge`")[2]
    program, toml = (
        re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)[0]
        for language in ("python", "toml")
    )
    (tmp_path / "server.py").write_text(LISTENING + program, encoding="utf-8")
    with serving(program=tmp_path / "server.py") as (address, _):
        tree = uqpen.run(uqpen.parse_study(toml.replace("http://127.0.0.1:4242", address)))
    made = tree["runs/sample"]
    expected = made["force"] * made["length"] ** 3 / 80.64e3
    assert made["deflection"].attrs["display_units"] == "mm"
    np.testing.assert_allclose(made["deflection"], expected / 1000, rtol=1e-12)
