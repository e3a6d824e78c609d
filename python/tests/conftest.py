"""Signals as a terminal has them: a shell's background jobs ignore Ctrl-C, and their children with them."""

import signal

import pytest


@pytest.fixture(autouse=True)
def ctrl_c():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before if before is not None else signal.SIG_DFL)
