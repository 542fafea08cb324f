"""Every change of a model that alters its results is met, by what the table of changes says."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from changed_models import CHANGES, NAMED, RECHECK

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="its states are forks of a process"),
]

STATES = Path(__file__).parents[1] / "model_states.py"


@pytest.fixture(scope="module")
def found():
    """What is reported of each change, and of the same model unchanged."""
    environment = {**os.environ, "PYTHONPATH": str(STATES.parent), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(STATES)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.name)
def test_a_changed_model_is_met_and_an_unchanged_one_raises_no_alarm(change, found):
    reported, same = (found[change.name][state] for state in ("changed", "unchanged"))
    if change.met.startswith(NAMED):
        assert reported["changes"] == []
        assert change.met.removeprefix(NAMED) in reported["uncompared"]
    elif change.met == RECHECK:
        assert reported["changes"] == []
    else:
        assert change.met in "; ".join(reported["changes"])
    alarms = [text for text in same["changes"] if "cannot be distinguished" not in text]
    assert alarms == []
