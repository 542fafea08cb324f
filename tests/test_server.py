"""uqpen's own models as a UM-Bridge server: by its class, and as the command."""

import contextlib
import http.client
import json
import re
import signal
import socket

import numpy as np
import pytest
import umbridge
from model_servers import asked, offering, serving

import uqpen
from uqpen.cli.serve import make_offers
from uqpen.core.errors import UqpenError
from uqpen.core.status import Status
from uqpen.execution import Evaluator
from uqpen.execution.processes import processes
from uqpen.models.known_functions import Ishigami
from uqpen.server import ModelServer, ServedModel, model_server

pytestmark = pytest.mark.slow

STUDY = """\
seed = 1
[model]
{model}
[inputs]
x1 = {{ uniform = {{ lower = -3.3, upper = 3 }} }}
x2 = {{ uniform = {{ lower = -3, upper = 3 }} }}
x3 = 1
[constraints]
keep = ["x1 > x2 - 4"]
[designs.some]
kind = "monte-carlo"
runs = 120
"""
CHAOS = '[surrogates.chaos]\nkind = "polynomial-chaos"\ndesign = "some"\n'
SERVED = """\
umbridge = "{}"
inputs = {{ x1 = "1", x2 = "1", x3 = "1" }}
outputs = {{ y = "1" }}"""
BUILT_IN = STUDY.format(model='use = "ishigami"')


@pytest.fixture(scope="module")
def address():
    with offering(ServedModel("ishigami", Evaluator(Ishigami()), ("x1", "x2", "x3"))) as address:
        yield address


class TestUMBridgeClient:
    def test_runs_a_model(self, address):
        assert umbridge.supported_models(address) == ["ishigami"]
        model = umbridge.HTTPModel(address, "ishigami")
        assert (model.get_input_sizes(), model.get_output_sizes()) == ([3], [1])
        assert model.supports_evaluate()
        assert not model.supports_gradient()
        assert not model.supports_apply_jacobian()
        assert not model.supports_apply_hessian()
        x = {name: np.array([0.3]) for name in ("x1", "x2", "x3")}
        assert model([[0.3, 0.3, 0.3]]) == [Ishigami().evaluate(x).outputs["y"].tolist()]

    @pytest.mark.parametrize(
        ("parameters", "config", "message"),
        [
            ([[4.0, 0.0, 0.0]], {}, "Inadmissible: x1 >= -3.14159 and <= 3.14159"),
            ([[0.0, 0.0]], {}, "InvalidInput: expected one vector of 3 numbers"),
            ([[0.0], [0.0, 0.0]], {}, "InvalidInput: expected one vector of 3 numbers"),
            ([["a", 0.0, 0.0]], {}, "InvalidInput: expected one vector of 3 numbers"),
            ([[True, 0.0, 0.0]], {}, "InvalidInput: expected one vector of 3 numbers"),
            ([[10**400, 0.0, 0.0]], {}, "InvalidInput: a number is too large"),
            ([[0.0, 0.0, 0.0]], {"a": 1}, "InvalidInput: ishigami takes no config"),
        ],
    )
    def test_a_caller_learns_why_a_run_was_not_made(self, address, parameters, config, message):
        model = umbridge.HTTPModel(address, "ishigami")
        with pytest.raises(Exception, match=re.escape(f"error of type {message}") + r"\Z"):
            model(parameters, config)


@pytest.mark.parametrize(
    ("path", "content", "code", "kind", "message"),
    [
        ("Evaluate", b"{", 400, "InvalidInput", "the request is no JSON object"),
        ("Evaluate", b"[" * 100_000, 400, "InvalidInput", "the request is no JSON object"),
        ("Evaluate", b"[]", 400, "InvalidInput", "the request is no JSON object"),
        ("Evaluate", b"{}", 400, "ModelNotFound", "no model null; known: ishigami"),
        ("ModelInfo", b'{"name": "x"}', 400, "ModelNotFound", 'no model "x"; known: ishigami'),
        ("Gradient", b'{"name": "ishigami"}', 400, "UnsupportedFeature",
         "Gradient is not supported"),
        ("EvaluateShMem", b'{"name": "ishigami"}', 400, "UnsupportedFeature",
         "EvaluateShMem is not supported"),
        ("Else", b"{}", 404, "NotFound", "/Else is not known"),
        ("Else", None, 404, "NotFound", "/Else is not known"),
        ("Evaluate", b"x" * 1_048_577, 413, "TooLarge", "a request has at most 1048576 bytes"),
        ("Evaluate", b" " * 30_000_000, 413, "TooLarge", "a request has at most 1048576 bytes"),
    ],
)  # fmt: skip
def test_what_is_no_run_gets_an_error_of_the_protocol(address, path, content, code, kind, message):
    reported = {"error": {"type": kind, "message": message}}
    assert asked(address, path, content) == (code, reported)


RUN = b'{"name": "ishigami", "input": [[0, 0, 0]]}'


@pytest.mark.parametrize(
    ("headers", "code", "message"),
    [
        ({}, 200, None),
        ({"Content_Type": "Application/JSON; charset=utf-8"}, 200, None),
        ({"Host": "localhost:80"}, 200, None),
        ({"Host": "LOCALHOST."}, 200, None),
        ({"Host": "[::1]:80"}, 200, None),
        ({"Host": "192.0.2.1"}, 200, None),
        ({"Host": "evil.example"}, 421, "this server is not evil.example; it is known by its"),
        ({"Host": "127.0.0.1.evil.example:80"}, 421, "this server is not 127.0.0.1.evil.example;"),
        ({"Host": ":80"}, 400, "the request does not tell its one host"),
        ({"Origin": "http://evil.example"}, 403, "pages in a browser are not served"),
        ({"Origin": "null"}, 403, "pages in a browser are not served"),
        ({"Content_Type": "text/plain"}, 415, "the content of a request is application/json"),
        ({"Content_Type": "application/x-www-form-urlencoded"}, 415,
         "the content of a request is application/json"),
    ],
)  # fmt: skip
def test_only_programs_that_mean_this_server_have_runs_made(address, headers, code, message):
    found, answer = asked(address, "Evaluate", RUN, **headers)
    assert found == code
    if message is None:
        assert answer == {"output": [[0.0]]}
    else:
        assert answer["error"]["message"].startswith(message)
    if code != 415:  # a list of models has no content
        assert asked(address, "Info", None, **headers)[0] == code


def test_a_host_name_that_was_given_is_known():
    offer = ServedModel("ishigami", Evaluator(Ishigami()), ("x1", "x2", "x3"))
    with ModelServer([offer], "localhost", 0) as server:
        server._name = "models.example.org"  # as if that name were known to this machine
        assert server.is_named("Models.Example.Org.")
        assert not server.is_named("example.org")
    with ModelServer([offer], "0.0.0.0", 0) as server:
        assert server.is_named("whatever.it.is.called")


def test_connections_beyond_a_number_are_reported(monkeypatch):
    monkeypatch.setattr(model_server, "_MOST_CONNECTIONS", 2)
    busy = {"type": "ServiceUnavailable", "message": "all 2 connections are in use"}
    offer = ServedModel("ishigami", Evaluator(Ishigami()), ("x1", "x2", "x3"))
    with offering(offer) as address, contextlib.ExitStack() as idle:
        port = int(address.rpartition(":")[2])

        def connect():
            client = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
            idle.callback(client.close)
            client.connect()
            return client

        def ask(client):
            client.request("GET", "/Info")
            answer = client.getresponse()
            return answer.status, json.load(answer)

        served = [connect(), connect()]
        assert [ask(client)[0] for client in served] == [200, 200]
        more = [connect(), connect()]
        assert ask(more[0]) == (503, {"error": busy})
        # A connection beyond these is closed without a word. It may be the first of two, as the one
        # that got its answer leaves its place at some moment; the last is asked first, so that the
        # server has met both.
        more += [connect(), connect()]
        closed = 0
        for client in reversed(more[2:]):
            try:
                assert ask(client) == (503, {"error": busy})
            except (ConnectionError, http.client.HTTPException):
                closed += 1
        assert closed
        for client in [*more, served[0]]:
            client.close()
        code = 503
        while code != 200:  # until the server has seen that they are closed
            with contextlib.suppress(ConnectionError, http.client.HTTPException):
                code = ask(connect())[0]
        assert ask(served[1])[0] == 200, "those that are served stay so"


@pytest.mark.parametrize(
    ("request_", "line"),
    [
        (b"DELETE / HTTP/1.1\r\n\r\n", b"HTTP/1.1 501 Not Implemented"),
        (b"POST /Evaluate HTTP/1.1\r\n\r\n", b"HTTP/1.1 411 Length Required"),
        (b"POST /Evaluate HTTP/1.1\r\nContent-Length: -1\r\n\r\n", b"HTTP/1.1 411 Length Required"),
        (b"nonsense nonsense nonsense\r\n\r\n", b"HTTP/1.1 400 Bad Request"),
    ],
)
def test_what_is_hardly_http_is_refused(address, request_, line):
    with socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2]))) as connection:
        connection.sendall(request_)
        connection.settimeout(60)
        answer = b""
        while part := connection.recv(65536):
            answer += part
    head, _, content = answer.partition(b"\r\n\r\n")
    assert head.splitlines()[0] == line or answer.startswith(b'{"error"')
    assert b"Traceback" not in answer
    assert "error" in json.loads(content or answer)


def test_a_model_served_gives_the_bits_of_the_model_here(address):
    here = uqpen.run(uqpen.parse_study(BUILT_IN))["runs/some"].to_dataset()
    study = uqpen.parse_study(STUDY.format(model=SERVED.format(address)))
    with processes(2) as pool:
        there = uqpen.run(study, map=pool)["runs/some"].to_dataset()
    for name in ("x1", "x2", "y"):
        np.testing.assert_array_equal(there[name], here[name])
    # What the model does not admit, the server refuses; what the study does not, is not asked.
    assert set(here["lost_reason"].values) == {"x1 >= -3.14159 and <= 3.14159", "x1 > x2 - 4"}
    assert set(there["lost_reason"].values) == {
        "Inadmissible: x1 >= -3.14159 and <= 3.14159",
        "x1 > x2 - 4",
    }
    assert (there["status"] != Status.OK).equals(here["status"] != Status.OK)


class TestOffers:
    def test_an_input_can_be_held(self):
        offer = ServedModel("a", Evaluator(Ishigami()), ("x3", "x1"), {"x2": 0.5})
        x = {"x1": np.array([2.0]), "x2": np.array([0.5]), "x3": np.array([1.0])}
        assert offer.run([1.0, 2.0]) == [Ishigami().evaluate(x).outputs["y"].tolist()]

    @pytest.mark.parametrize(
        ("varied", "held", "message"),
        [
            (("x1",), {}, "a also needs x2, x3"),
            (("x1", "x1"), {"x2": 0.5, "x3": 0.5}, "a: an input is given twice: x1, x1"),
            (("x4",), {}, 'ishigami has no input "x4"; known: x1, x2, x3'),
        ],
    )
    def test_what_does_not_fit_is_reported(self, varied, held, message):
        with pytest.raises(UqpenError) as refused:
            ServedModel("a", Evaluator(Ishigami()), varied, held)
        assert str(refused.value) == message


class TestCommand:
    def test_serves_until_it_is_interrupted(self, tmp_path):
        (tmp_path / "study.toml").write_text(BUILT_IN)
        with serving(tmp_path, "study.toml", "--inputs", "x2, x1") as (said, address, process):
            assert [line.split() for line in said.splitlines() if line[:1] in tuple("xyl")] == [
                ["x2", "1", ">=", "-3.14159", "and", "<=", "3.14159"],
                ["x1", "1", ">=", "-3.14159", "and", "<=", "3.14159"],
                ["x3", "1", "1"],
                ["y", "1", "a", "number"],
                f"listening at {address} (UM-Bridge); Ctrl-C ends it".split(),
            ]
            assert umbridge.HTTPModel(address, "ishigami")([[0.0, 0.0]]) == [[0.0]]
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=60)
        assert (process.returncode, out, err) == (0, "", "stopped\n")

    def test_a_built_in_model_takes_what_must_be_given(self):
        (offer,) = make_offers("walker-anderson")
        assert offer.fixed_inputs == {"smoothing": 0.0}
        assert len(offer.varied_inputs) == 9
        assert "projectile_sound_speed" in offer.varied_inputs
        assert "projectile_young_modulus" not in offer.varied_inputs

    def test_a_study_takes_what_it_draws(self, tmp_path):
        (tmp_path / "study.toml").write_text(BUILT_IN)
        (offer,) = make_offers(str(tmp_path / "study.toml"))
        assert (offer.name, offer.varied_inputs, offer.fixed_inputs) == (
            "ishigami",
            ("x1", "x2"),
            {"x3": 1.0},
        )
        several = BUILT_IN.replace("[model]", "[models.a]").replace(
            "[inputs]", "[models.b]\nuse = 'ishigami'\nwith = { x3 = 2 }\n[inputs]"
        )
        (tmp_path / "several.toml").write_text(several)
        found = make_offers(str(tmp_path / "several.toml"))
        assert [(offer.name, offer.fixed_inputs) for offer in found] == [
            ("a", {"x3": 1}),
            ("b", {"x3": 2}),
        ]

    def test_an_archive_gives_its_surrogates(self, tmp_path):
        text = BUILT_IN.replace("120", "60") + CHAOS
        tree = uqpen.run(uqpen.parse_study(text))
        uqpen.write(tree, tmp_path / "study.nc")
        made = tree["runs/some"].to_dataset()
        ok = made.isel(run=np.flatnonzero(made["status"] == Status.OK)[:20])
        points = np.stack([ok["x1"], ok["x2"]], axis=1).tolist()
        (offer,) = make_offers(f"{tmp_path}/study.nc:chaos")
        assert make_offers(f"{tmp_path}/study.nc")[0].name == offer.name == "chaos"
        fitted = [offer.run(point)[0][0] for point in points]
        assert np.corrcoef(fitted, ok["y"])[0, 1] > 0.9
        with offering(offer) as address:
            model = umbridge.HTTPModel(address, "chaos")
            assert [model([point])[0][0] for point in points] == fitted
            with pytest.raises(Exception, match="Inadmissible: x1 > x2 - 4"):
                model([[-2.9, 2.9]])
            with pytest.raises(Exception, match=r"Inadmissible: x1 >= -3\.14159"):
                model([[-3.2, 0.0]])

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (["ishigamy"], 'no built-in model "ishigamy"; did you mean "ishigami"?'),
            (["ishigami", "--inputs", "x1"], "ishigami also needs x2, x3"),
            (["ishigami", "--inputs", "x1,x2,x4"], 'ishigami has no input "x4"'),
            (["none.toml"], "none.toml: cannot be read: No such file or directory"),
            (["none.nc:a"], "none.nc: there is no such file"),
            (
                ["ishigami", "--host", "192.0.2.1"],
                "cannot listen at 192.0.2.1, port 4242: Cannot assign requested address",
            ),
        ],
    )
    def test_mistakes(self, command_line, arguments, message):
        done = command_line("serve", *arguments)
        assert done.code == 2
        assert message in done.err

    def test_a_port_that_is_taken(self, command_line):
        with socket.create_server(("127.0.0.1", 0)) as other:
            port = other.getsockname()[1]
            done = command_line("serve", "ishigami", "--port", str(port))
        assert done.code == 2
        assert f"cannot listen at 127.0.0.1, port {port}: Address already in use" in done.err

    def test_an_archive_without_that_surrogate(self, command_line, tmp_path):
        text = BUILT_IN.replace("120", "10")
        uqpen.write(uqpen.run(uqpen.parse_study(text)), tmp_path / "study.nc")
        done = command_line("serve", "study.nc:chaos")
        assert done.code == 2
        assert done.err == 'study.nc: no surrogate "chaos"; none is known\n'
        done = command_line("serve", "study.nc")
        reported = "study.nc: holds no surrogate, and nothing else of it can be served\n"
        assert (done.code, done.err) == (2, reported)
