"""A process beside this one."""

import os
import signal

import numpy as np
import pytest

from bsmap_cli.beside import CAN_FORK, Beside, halves

pytestmark = pytest.mark.skipif(not CAN_FORK, reason="no process is forked here")


def echo(pipe, times):
    while message := pipe.recv_bytes():
        pipe.send_bytes(times * message)


def fail(pipe):
    raise ZeroDivisionError


def test_messages_go_there_and_back():
    other = Beside(echo, 3)
    other.send(b"oh")
    assert other.pipe.recv_bytes() == b"ohohoh"
    other.end()
    assert not other.process.is_alive()


def test_it_does_not_hear_ctrl_c():
    other = Beside(echo, 1)
    os.kill(other.process.pid, signal.SIGINT)
    other.send(b"still there?")
    assert other.pipe.recv_bytes() == b"still there?"
    other.end()


def test_it_ends_with_the_first_one():
    other = Beside(echo, 1)
    other.pipe.close()  # as where this process is killed
    other.process.join(timeout=20.0)
    assert other.process.exitcode == 0


def test_it_fails_without_a_word(capfd):
    other = Beside(fail)
    with pytest.raises(EOFError):
        other.pipe.recv_bytes()
    other.send(b"nobody hears it")
    other.end()
    assert capfd.readouterr() == ("", "")


def test_signals_are_heard_again_after_the_fork():
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    Beside(echo, 1).end()
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == before


def test_rows_are_made_by_two():
    def rows(begin, end):
        return np.array([(k, os.getpid()) for k in range(begin, end)])

    made = halves(rows, 7)
    assert made[:, 0].tolist() == list(range(7))
    assert len(set(made[:, 1].tolist())) == 2


def test_rows_that_nobody_else_could_make_are_made_here():
    here = os.getpid()

    def rows(begin, end):
        assert os.getpid() == here
        return np.arange(begin, end)

    assert halves(rows, 7).tolist() == list(range(7))


def test_all_rows_are_made_here_where_there_is_no_process(monkeypatch):
    def fork():
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(os, "fork", fork)
    assert halves(np.arange, 7).tolist() == list(range(7))
