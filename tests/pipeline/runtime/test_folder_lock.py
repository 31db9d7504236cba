"""One program at a time in a results folder."""

import errno
import os
import signal
import subprocess
import sys

import filelock
import pytest

from pipeline.errors import InputError
from pipeline.runtime.folder_lock import LOCK_FILE, locked

HOLD = """
import sys, time
from pipeline.runtime.folder_lock import locked
with locked(sys.argv[1]):
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_second_one_is_refused_and_the_first_named(tmp_path):
    with locked(tmp_path):
        for _ in range(2):
            with (
                pytest.raises(InputError, match=f"{tmp_path}: another.*process {os.getpid()} on"),
                locked(tmp_path),
            ):
                pass
    with locked(tmp_path):
        pass


def test_a_killed_program_leaves_no_lock(tmp_path):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    program = subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True)
    try:
        assert program.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=f"process {program.pid} on"), locked(tmp_path):
            pass
    finally:
        program.send_signal(signal.SIGKILL)
        program.communicate()
    with locked(tmp_path):
        assert str(os.getpid()) in (tmp_path / LOCK_FILE).read_text()


def test_a_fault_inside_releases_it(tmp_path):
    with pytest.raises(ZeroDivisionError), locked(tmp_path):
        raise ZeroDivisionError
    with locked(tmp_path):
        pass


def test_where_no_lock_can_be(tmp_path):
    (tmp_path / LOCK_FILE).mkdir()
    with (
        pytest.raises(InputError, match=r"cannot lock it .*; copy it .*choose another"),
        locked(tmp_path),
    ):
        pass


def test_a_folder_that_may_not_be_written_is_named_without_the_lock(tmp_path, monkeypatch):
    def refuse(*_, **options):
        raise PermissionError(errno.EACCES, "no", str(tmp_path / LOCK_FILE))

    monkeypatch.setattr(filelock.FileLock, "acquire", refuse)
    with pytest.raises(InputError) as caught, locked(tmp_path):
        pass
    reason = "cannot write there (Permission denied)"
    advice = "copy it to where you may write, or choose another folder"
    assert str(caught.value) == f"{tmp_path}: {reason}; {advice}"
