"""Runs in jobs of SLURM: on a real one on the loopback interface where it can be started."""

import contextlib
import os
import shutil
import socket
import subprocess
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import distributed
import pytest
from study_text import study_text

import uqpen
from uqpen.core.errors import ClusterError
from uqpen.execution import cluster
from uqpen.execution import slurm as slurm_module
from uqpen.execution.cluster import Attendance
from uqpen.execution.slurm import JobArray, slurm

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo")
CONFIGURATION = """\
ClusterName=tests
SlurmctldHost={host}(127.0.0.1)
AuthInfo=socket={folder}/munge.socket
SlurmUser=root
SlurmdUser=root
SlurmctldPort={controller}
SlurmdPort={daemon}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
StateSaveLocation={folder}
SlurmdSpoolDir={folder}/spool
ProctrackType=proctrack/pgid
TaskPlugin=task/none
MailProg=/bin/true
ReturnToService=2
SlurmdParameters=config_overrides
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,batch_sched_delay=0,sched_min_interval=0
KillWait=2
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 State=UNKNOWN
PartitionName=tests Nodes={host} Default=YES MaxTime=60 State=UP
"""

# It tells how many runs have begun, and takes its time while somebody waits for that.
MODEL = """\
import pathlib, time
here = pathlib.Path(__file__).parent

def simulate(x):
    with (here / "calls").open("a") as calls:
        calls.write("call\\n")
    if not (here / "hurry").exists():
        time.sleep(0.2)
    return {"y": x**3}
"""
STUDY = study_text(
    {"python": "slow.py:simulate", "inputs": {"x": "1"}, "outputs": {"y": "m"}},
    seed=5,
    inputs={"x": "0 ± 1"},
    designs={"some": {"kind": "monte-carlo", "runs": 40}},
)


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    """SLURM with one node, this machine; its processes are ended by their handles."""
    path = os.pathsep.join([os.environ["PATH"], "/usr/sbin"])
    if missing := [name for name in PROGRAMS if not shutil.which(name, path=path)]:
        pytest.skip(f"SLURM is not installed: no {', '.join(missing)}")
    if os.geteuid() != 0:
        pytest.skip("only root can start slurmd for the jobs of others")
    folder = tmp_path_factory.mktemp("slurm")
    host = socket.gethostname().partition(".")[0]
    ports = dict(zip(("controller", "daemon"), _free_ports(2), strict=True))
    (folder / "slurm.conf").write_text(CONFIGURATION.format(folder=folder, host=host, **ports))
    key = folder / "munge.key"
    key.write_bytes(os.urandom(128))
    key.chmod(0o600)
    with contextlib.ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("SLURM_CONF", str(folder / "slurm.conf"))
        patch.setenv("PATH", path)
        files = {"socket": "socket", "log-file": "log", "pid-file": "pid", "seed-file": "seed"}
        munge = [f"--{option}={folder}/munge.{ending}" for option, ending in files.items()]
        for words in (
            ["munged", "--foreground", "--force", f"--key-file={key}", *munge],
            ["slurmctld", "-D", "-i"],
            ["slurmd", "-D"],
        ):
            _start(words, stack)
        for _ in range(100):
            states = subprocess.run(["sinfo", "-h", "-o", "%T"], capture_output=True, check=False)
            if states.stdout == b"idle\n":
                break
            time.sleep(0.2)
        else:
            pytest.skip("SLURM does not start here")
        yield


def _start(words, stack):
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def end():
        process.terminate()
        process.wait(timeout=30)

    stack.callback(end)


def _free_ports(count):
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_job_that_ends_is_replaced_and_the_archive_is_the_same(controller, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(slurm_module, "_BETWEEN_LOOKS", 1.0)
    (tmp_path / "slow.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY)
    study = uqpen.load_study("study.toml")
    texts = []

    def cancel_one():
        while not Path("calls").exists():
            time.sleep(0.05)
        (job, *_) = subprocess.check_output(["squeue", "-hr", "-t", "R", "-o", "%i"]).split()
        subprocess.run(["scancel", job], check=True)

    killer = threading.Thread(target=cancel_one, daemon=True)
    killer.start()
    with slurm(2, "--time=5", texts.append) as jobs:
        uqpen.make_archive(study, "jobs.nc", map=jobs)
    killer.join()
    (tmp_path / "hurry").touch()
    calls = (tmp_path / "calls").read_text().count("call")
    assert 40 <= calls <= 42  # what the cancelled job worked on was made again
    uqpen.make_archive(uqpen.load_study("study.toml"), "here.nc")
    assert Path("jobs.nc").read_bytes() == Path("here.nc").read_bytes()
    assert "1 of 2 jobs of SLURM have ended; as many are submitted" in texts


@pytest.mark.slow
def test_what_slurm_refuses_is_shown(controller, tmp_path, command_line):
    (tmp_path / "slow.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY)
    done = command_line("study", "study.toml", "--slurm", "2", "--sbatch", "--partition=none")
    assert (done.code, done.out) == (2, "")
    assert "SLURM refuses: error: Batch job submission failed: Invalid partition" in done.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--slurm", "2"], "--slurm: found no sbatch here; expected the commands of SLURM"),
        (["--slurm", "2", "--workers", "2"], "--workers and --slurm exclude each other"),
        (["--sbatch", "--time=5"], "--sbatch is for --slurm"),
    ],
)
def test_mistakes(arguments, message, command_line, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    (tmp_path / "slow.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY)
    done = command_line("study", "study.toml", *arguments)
    assert done.code == 2
    assert message in done.err


class Commands:
    """SLURM's commands, whose queue is what the test says."""

    def __init__(self):
        self.live = 0
        self.submitted = []

    def call(self, words, script=""):
        if words[0] == "squeue":
            return "1_1\n" * self.live
        self.submitted.append(words)
        return "1\n"


def test_jobs_that_complete_nothing_end_the_study(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    commands, now, texts = Commands(), [0.0], list[str]()
    monkeypatch.setattr(slurm_module, "_call", commands.call)
    array = JobArray(3, ["--time=5"], "tcp://here:1", texts.append, clock=lambda: now[0])
    array.submit(3)
    for completed, live, expected in ((0, 3, 1), (0, 1, 2), (5, 2, 3), (5, 0, 4), (5, 0, 5)):
        now[0] += 60
        commands.live = live
        array.renew(completed)
        assert len(commands.submitted) == expected
    assert [words[2] for words in commands.submitted] == [
        f"--array=1-{jobs}" for jobs in (3, 2, 1, 3, 3)
    ]
    assert texts[0] == "2 of 3 jobs of SLURM have ended; as many are submitted"
    now[0] += 60
    with pytest.raises(ClusterError, match="9 jobs of SLURM have ended, and no run was completed"):
        array.renew(5)


def test_a_worker_leaves_runs_that_would_outlast_its_job(monkeypatch):
    left = []
    loop = SimpleNamespace(add_callback=left.append)
    worker = SimpleNamespace(loop=loop, close_gracefully="closed")
    monkeypatch.setattr(distributed, "get_worker", lambda: worker)
    monkeypatch.setattr(cluster, "_UNTIL_FETCHED", 0.0)
    monkeypatch.setenv(cluster.ENDS_AT, "")
    cluster.leave_if_late(1e9)
    monkeypatch.setenv(cluster.ENDS_AT, str(time.time() + 1000))
    cluster.leave_if_late(0.0)  # a worker that does not know how long a run takes
    cluster.leave_if_late(700.0)
    assert left == []
    with pytest.raises(distributed.Reschedule):
        cluster.leave_if_late(900.0)  # it may take a fifth longer
    assert left == ["closed"]


def test_a_study_without_workers_says_so_and_for_how_long():
    now, texts = [0.0], list[str]()
    attendance = Attendance(texts.append, clock=lambda: now[0])
    for second in range(100):
        now[0] = second
        attendance.record(0)
    assert texts == [
        f"the cluster has had no worker for 0:{text}; the study waits for one"
        for text in ("00:10", "00:20", "00:40", "01:20")
    ]
    now[0] = 125
    attendance.record(4)
    attendance.record(4)
    assert texts[4:] == ["the cluster has workers again, after 0:02:05 without"]
    now[0] = 130
    attendance.record(0)
    now[0] = 135
    attendance.record(2)
    assert len(texts) == 5
