"""Remarks of verbs are printed, and let the verb go on, whatever Python is told about warnings."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SCRIPT = """
import warnings
from mirrorfold.cli import main, program

def run(arguments):
    for _ in range(2):
        warnings.warn("the array is short")
    print("done")

program.run = run
raise SystemExit(main())
"""


@pytest.mark.parametrize("said", [None, "error", "ignore", "error::UserWarning", "ignore::UserWarning"])
def test_remarks_are_printed_once_whatever_python_does_with_warnings(said):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONWARNINGS"}
    environment |= {} if said is None else {"PYTHONWARNINGS": said}
    command = [sys.executable, "-c", SCRIPT, "info", "a.nc"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, "done\n"), done.stderr
    assert done.stderr == "mirrorfold: note: the array is short\n"
