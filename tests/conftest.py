"""Ctrl-C means the same however the tests were started: a shell's background jobs, and so their children, ignore it."""

import signal

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
