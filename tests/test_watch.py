"""A running study on a page: what it shows, over real HTTP, and in a browser."""

import contextlib
import http.client
import json
import re
import select
import signal
import socket
import subprocess
import sys
import time

import pytest
from browsers import chromium
from study_text import study_text

import uqpen
from uqpen.core.progress import ProgressBroadcast
from uqpen.execution import Progress
from uqpen.server.watch_server import serve_watch_page, watch_state
from uqpen.workflow.running_results import RunningResults

# Long enough for a machine that is busy with other work; nothing waits for it to pass.
PATIENCE = 120

DESIGNS = """
[outputs.y]
exceeds = [0.75]
[designs.draws]
kind = "monte-carlo"
runs = 3000
[designs.blocks]
kind = "saltelli"
base = 1024
"""
STATE = {
    "title": "Beam <b>1</b>",
    "step": "design 1 of 2: draws",
    "runs": "50 of 100 runs",
    "done": 50,
    "total": 100,
    "designs": [["draws", "50", "below"], ["blocks", "0", "none: its points form blocks"]],
    "tables": [
        {
            "title": "y [mm]",
            "columns": ["draws"],
            "rows": [["runs", "50"], ["mean", "0.50 ± 0.08 ¹"]],
            "notes": ["fewer than 200 runs <script>document.title = 'hurt'</script>"],
        }
    ],
    "causes": [{"text": "residual …", "runs": "3", "status": "failed", "example": "residual 5e-4"}],
}


class Seen(Progress):
    """Keeps what a page would show after each report of finished runs.

    Its clock goes on before each of them, so that an update is always due.
    """

    def __init__(self, study):
        self.time = 0.0
        self.running = RunningResults(study, lambda: self.time)
        self.states = []

    def start_design(self, name, runs):
        self.time += 5

    def advance(self, runs, failed, in_progress):
        self.states.append(watch_state(self.running))
        self.time += 5


def watched(study):
    """The archive of a study, and what its page showed."""
    seen = Seen(study)
    archive = uqpen.run(study, progress=ProgressBroadcast(seen.running, seen))
    return archive, seen


def cells(state, row):
    return next(cells for label, *cells in state["tables"][0]["rows"] if label == row)


def test_estimates_are_those_of_the_first_runs(study_of):
    archive, seen = watched(study_of("x", DESIGNS, x=(0, 1)))
    state = seen.states[1]  # after two batches of 1 024
    assert cells(state, "runs") == ["2\u202f048"]
    values = archive["runs/draws"]["y"].values[:2048]
    mean, _ = cells(state, "mean")[0].split(" ± ")
    assert float(mean) == pytest.approx(values.mean(), abs=0.005)
    share = float(cells(state, "P(> 0.75)")[0].split(" ")[0])
    assert share == pytest.approx((values > 0.75).mean(), abs=0.005)
    last = seen.states[-1]
    assert cells(last, "runs") == ["3\u202f000"], "a whole design stays"
    finished = {name: (runs, why) for name, runs, why in last["designs"]}
    assert finished["draws"] == ("3\u202f000", "below")
    assert finished["blocks"][1] == (
        "none: its points form blocks, and a part of them is no sample of the inputs"
    )


def test_failures_are_counted_by_cause(study_of):
    text = '[designs.draws]\nkind = "monte-carlo"\nruns = 64\n'
    study = study_of("np.where(x > 0.5, np.nan, x)", text, x=(0, 1))
    _, seen = watched(study)
    (cause,) = seen.states[-1]["causes"]
    assert cause["status"] == "not finite"
    assert int(cause["runs"]) > 10
    assert f"{cause['runs']} failed" in seen.states[-1]["runs"]


def test_the_archive_is_the_same_with_and_without(study_of, tmp_path):
    study = study_of("np.exp(x) * z", DESIGNS, x=(0, 1), z=(1, 2))
    uqpen.make_archive(study, tmp_path / "without.nc")
    seen = Seen(study)
    progress = ProgressBroadcast(seen.running, seen)
    uqpen.make_archive(study, tmp_path / "with.nc", progress=progress)
    assert cells(seen.states[0], "runs") == ["1\u202f024"]
    assert (tmp_path / "with.nc").read_bytes() == (tmp_path / "without.nc").read_bytes()


def test_rounds_and_several_models_are_distinguished():
    study = uqpen.Study(
        models={
            name: uqpen.PythonModel(
                lambda x, factor=factor: {"y": factor * x}, {"x": "1"}, {"y": "1"}, vectorized=True
            )
            for name, factor in (("one", 1.0), ("ten", 10.0))
        },
        inputs={"x": uqpen.Uniform(0, 1)},
        outputs={"y": "1"},
        designs={
            "some": uqpen.MonteCarlo(until=uqpen.Precision({"y": {"mean": 0.01}}), at_most=8192)
        },
        seed=1,
    )
    archive, seen = watched(study)
    assert archive["models/one/runs/some"].sizes["run"] > 512, "it has several rounds"
    tables = watch_state(seen.running)["tables"]
    assert [table["title"] for table in tables] == ["one: y", "ten: y"]
    size = archive["models/one/runs/some"].sizes["run"]
    for table in tables:
        label, count = table["rows"][0]
        assert (label, int(re.sub(r"\D", "", count.split(" ")[0]))) == ("runs", size)


def test_a_failing_estimate_ends_no_study(study_of, monkeypatch):
    def fail(*_, **__):
        raise ZeroDivisionError("by nought")

    monkeypatch.setattr("uqpen.workflow.running_results.analyze", fail)
    _, seen = watched(study_of("x", DESIGNS, x=(0, 1)))
    assert seen.states[-1]["designs"][0][2] == "none: they fail: ZeroDivisionError: by nought"


class TestServer:
    """The page over real HTTP."""

    def ask(self, server, path, method="GET", host=None):
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=PATIENCE)
        headers = {} if host is None else {"Host": host}
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        return answer.status, answer.headers, content

    @pytest.mark.parametrize(
        ("path", "kind", "part"),
        [
            ("/", "text/html; charset=utf-8", b"Do not stop the study by what you see here"),
            ("/watch.css", "text/css; charset=utf-8", b"--paper"),
            ("/watch.js", "text/javascript; charset=utf-8", b"state.json"),
        ],
    )
    def test_its_files_load_nothing_from_elsewhere(self, path, kind, part):
        with serve_watch_page(lambda: STATE) as server:
            status, headers, content = self.ask(server, path)
        assert status == 200
        assert headers["Content-Type"] == kind
        assert part in content
        assert b"://" not in content
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert "unsafe" not in headers["Content-Security-Policy"]
        assert headers["Cache-Control"] == "no-store"

    @pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "evil.example:{port}", ""])
    def test_a_request_for_another_host_is_refused(self, host):
        """The name of a foreign page may be made to stand for this machine."""
        with serve_watch_page(lambda: STATE) as server:
            host = host.format(port=server.port)
            status, _, content = self.ask(server, "/state.json", host=host)
            assert status == 421
            assert b"Beam" not in content
            assert self.ask(server, "/", host=f"localhost:{server.port}")[0] == 200

    def test_nothing_can_be_changed_or_found(self):
        with serve_watch_page(lambda: STATE) as server:
            for method in ("POST", "PUT", "DELETE", "OPTIONS"):
                assert self.ask(server, "/state.json", method)[0] == 501
            for path in ("/study.nc", "/../watch_server.py", "/watch.js?x=1"):
                assert self.ask(server, path)[0] == 404
            status, headers, content = self.ask(server, "/", "HEAD")
            assert (status, content) == (200, b"")
            assert int(headers["Content-Length"]) > 1000

    def test_clients_that_say_nothing_take_a_limited_number_of_connections(self):
        with serve_watch_page(lambda: STATE) as server, contextlib.ExitStack() as idle:
            # Fewer than it takes else: so many at a time wait for no second try to connect.
            server.most_connections = 4
            address = ("127.0.0.1", server.port)
            clients = [
                idle.enter_context(socket.create_connection(address, timeout=PATIENCE))
                for _ in range(6)
            ]
            # The server closes those that it does not serve, and says nothing to the others.
            closed, _, _ = select.select(clients, [], [], PATIENCE)
            assert closed
            while len(closed) < 2:
                closed, _, _ = select.select(clients, [], [], 0.05)
            assert [client.recv(1) for client in closed] == [b""] * 2
            assert server.connections == 4
            idle.pop_all().close()
            code = 0
            while code != 200:  # until the server has seen that they have left
                with contextlib.suppress(ConnectionError, http.client.HTTPException):
                    code = self.ask(server, "/")[0]


MODEL = """
import time
from pathlib import Path

def f(x):
    if x > 0.9:
        raise ValueError(f"no convergence (residual {x})")
    time.sleep(0.005)  # a batch then has about ten runs, fewer where this takes longer
    with open("calls", "a") as calls:
        calls.write("x")
    while Path("calls").stat().st_size > 60:
        time.sleep(0.01)
    return {"y": x}
"""
STUDY = study_text(
    {"python": "model.py:f", "inputs": {"x": "1"}, "outputs": {"y": "1"}},
    title="Slow",
    inputs={"x": (0, 1)},
    designs={"draws": {"kind": "monte-carlo", "runs": 200}},
)


@pytest.mark.slow
def test_the_command_serves_its_page_until_the_study_is_interrupted(tmp_path):
    (tmp_path / "model.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY)
    line = [sys.executable, "-m", "uqpen", "study", "--watch", "study.toml"]
    with subprocess.Popen(
        line, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        reported = process.stderr.readline()
        match = re.fullmatch(
            r"watch: http://127\.0\.0\.1:(\d+)/ shows the results so far, until the study ends\n",
            reported,
        )
        assert match, reported
        state = _state(int(match[1]))
        deadline = time.monotonic() + PATIENCE
        while not state["done"] > 20:
            assert time.monotonic() < deadline
            state = _state(int(match[1]))
        assert state["title"] == "Slow"
        assert state["step"] == "draws"
        assert state["total"] == 200
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "runs are kept; the same command continues" in said
    with pytest.raises(ConnectionRefusedError):
        _state(int(match[1]))


def _state(port):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    connection.request("GET", "/state.json")
    state = json.loads(connection.getresponse().read())
    connection.close()
    return state


def test_a_port_in_use_is_a_mistake(command_line, tmp_path):
    (tmp_path / "model.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY)
    with serve_watch_page(lambda: STATE) as server:
        outcome = command_line("study", "study.toml", "--watch", str(server.port))
    assert outcome.code == 2
    assert f"--watch: cannot listen at port {server.port}" in outcome.err
    assert not (tmp_path / "calls").exists(), "no model has run"


@pytest.mark.slow
def test_a_browser_follows_the_study():
    state = dict(STATE)
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 390, "height": 800})
        said = []
        page.on("console", lambda message: said.append(message.text))
        with serve_watch_page(lambda: state) as server:
            page.goto(server.url)
            page.wait_for_selector("body[data-state=running]", timeout=1000 * PATIENCE)
            assert page.inner_text("h1") == "Beam <b>1</b>", "text, not HTML"
            assert page.title() == "50 % – Beam <b>1</b>"
            assert "0.50 ± 0.08 ¹" in page.inner_text("#tables")
            assert "its points form blocks" in page.inner_text("#designs")
            assert "residual 5e-4" in page.inner_text("#causes")
            width = page.evaluate("document.documentElement.scrollWidth")
            assert width == 390, "tables scroll by themselves"
            state["runs"] = "99 of 100 runs"
            page.wait_for_selector("#runs:has-text('99 of 100')", timeout=1000 * PATIENCE)
            assert said == []
        page.wait_for_selector("body[data-state=ended]", timeout=1000 * PATIENCE)
        assert "has ended, or was interrupted" in page.inner_text("#step")
        assert "99 of 100" in page.inner_text("#runs"), "the last state stays"
