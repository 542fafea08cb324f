"""Execution in jobs of SLURM: an array of jobs, each a worker of a Dask scheduler here."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from uqpen.core.errors import ClusterError
from uqpen.execution.cluster import ENDS_AT, Cluster, import_distributed

# Folder of what the jobs print, in the folder of the study's start.
_LOGS = "slurm_logs"

# Seconds between two looks at the queue.
_BETWEEN_LOOKS = 15.0

# The end of a job is known when it runs: its queue, its options and its partition limit its time.
# Dask's worker leaves in time before, so that what it works on is not taken for a crash.
_SCRIPT = """#!/bin/sh
job="${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
{ends_at}=$(date -d "$(squeue -h -o %e -j "$job")" +%s 2>/dev/null)
export {ends_at}
if [ -n "${ends_at}" ]; then
    {ends_at}=$(({ends_at} - 10))
    set -- --lifetime "$(({ends_at} - $(date +%s)))s"
fi
exec {python} -m dask worker {address} --nthreads 1 --no-nanny --no-dashboard \\
    --death-timeout 60 --name "slurm-$job" "$@"
"""


@contextmanager
def slurm(jobs: int, options: str, report: Callable[[str], None]) -> Iterator[Cluster]:
    """Start jobs that make runs; yield them as a map like the built-in.

    Parameters
    ----------
    jobs : int
        Number of jobs at a time. A job makes one run at a time, with all its cores.
    options : str
        Options of ``sbatch``, such as ``--time=2:00:00 --cpus-per-task=4``.
    report : callable
        Receives reports on jobs and workers.

    Raises
    ------
    ClusterError
        If there is no SLURM here, or it refuses the jobs.
    """
    distributed = import_distributed("slurm")
    if missing := [name for name in ("sbatch", "squeue", "scancel") if not shutil.which(name)]:
        raise ClusterError(f"--slurm: found no {missing[0]} here; expected the commands of SLURM")
    from distributed.utils import get_ip

    # No page of Dask; what is left of its server takes any free port of this machine.
    own = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
    with (
        distributed.LocalCluster(
            n_workers=0, host=get_ip(), dashboard_address=None, scheduler_kwargs=own
        ) as scheduler,
        distributed.Client(scheduler, set_as_default=False) as client,
    ):
        array = JobArray(jobs, shlex.split(options), scheduler.scheduler_address, report)
        try:
            array.submit(jobs)
            yield Cluster(client, report, array)
        finally:
            array.cancel()


class JobArray:
    """Jobs of SLURM that are workers; one that has ended is replaced.

    Parameters
    ----------
    size : int
        Number of jobs at a time.
    options : sequence of str
        Options of ``sbatch``.
    address : str
        Address of the Dask scheduler.
    report : callable
        Receives a text when jobs are replaced.
    clock : callable
        Returns the time in seconds.
    """

    def __init__(
        self,
        size: int,
        options: Sequence[str],
        address: str,
        report: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.size = size
        self._options = options
        self._report = report
        self._clock = clock
        self._name = f"uqpen-{uuid.uuid4().hex[:12]}"
        python = shlex.quote(sys.executable)
        self._script = _SCRIPT.format(ends_at=ENDS_AT, python=python, address=address)
        self._looked_at = clock()
        self._completed = 0
        self._futile = 0

    def submit(self, jobs: int) -> None:
        """Submit an array of jobs."""
        logs = Path(_LOGS)
        logs.mkdir(exist_ok=True)
        own = [f"--array=1-{jobs}", f"--job-name={self._name}", f"--output={logs}/%A_%a.log"]
        _call(["sbatch", "--parsable", *own, *self._options], self._script)

    def renew(self, completed: int) -> None:
        """Replace the jobs that have ended; `completed` is the number of batches so far.

        Raises
        ------
        ClusterError
            If jobs have been replaced twice, and none of them has completed a batch.
        """
        if self._clock() - self._looked_at < _BETWEEN_LOOKS:
            return
        self._looked_at = self._clock()
        missing = self.size - self._live()
        if missing <= 0:
            return
        self._futile = self._futile + missing if completed == self._completed else 0
        self._completed = completed
        if self._futile > 2 * self.size:
            raise ClusterError(
                f"{self._futile} jobs of SLURM have ended, and no run was completed meanwhile: "
                f"see {_LOGS}, and whether a run takes longer than a job"
            )
        self._report(f"{missing} of {self.size} jobs of SLURM have ended; as many are submitted")
        self.submit(missing)

    def cancel(self) -> None:
        """End all jobs."""
        subprocess.run(["scancel", f"--name={self._name}"], capture_output=True, check=False)

    def _live(self) -> int:
        """Return the number of jobs that wait or run."""
        states = "--states=PENDING,CONFIGURING,RUNNING,SUSPENDED"
        words = ["squeue", "--noheader", "--array", "--format=%i", states, f"--name={self._name}"]
        return len(_call(words).split())


def _call(words: Sequence[str], script: str = "") -> str:
    """Return what a command of SLURM prints."""
    done = subprocess.run(words, input=script, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise ClusterError(f"SLURM refuses: {reason.removeprefix(f'{words[0]}: ')}")
    return done.stdout
