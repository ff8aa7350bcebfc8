"""No call that Windows lacks is reached there: each stands under a question for the system, or under one named here.

Nobody runs Python on Windows here, so this is read from the text: what is imported, what is asked of `os` and `signal`.
"""

import ast
from collections.abc import Iterator

import pytest
from imports import FILES

MODULES = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog", "posix", "readline", "curses"}
"""Modules of Python that are not there on Windows."""
OF_OS = """
WNOHANG chown chroot confstr ctermid fchdir fchmod fchown fork forkpty fstatvfs getegid geteuid getgid getgroups
getloadavg getpgid getpgrp getpriority getsid getuid killpg lchown mkfifo mknod nice openpty pathconf pipe2
posix_fadvise posix_fallocate posix_spawn pread pwrite register_at_fork sched_getaffinity sched_setaffinity
sched_yield sendfile setegid seteuid setgid setgroups setpgid setpriority setsid setuid statvfs sync sysconf
tcgetpgrp ttyname uname wait wait3 wait4 waitid O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_SYNC
"""
OF_SIGNAL = """
SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGPROF SIGQUIT SIGSTOP SIGTSTP SIGTTIN SIGTTOU SIGUSR1 SIGUSR2
SIGVTALRM SIGWINCH SIGXCPU SIGXFSZ SIG_BLOCK SIG_SETMASK SIG_UNBLOCK alarm getitimer pause pthread_kill
pthread_sigmask setitimer siginterrupt sigpending sigtimedwait sigwait sigwaitinfo ITIMER_REAL ITIMER_PROF
ITIMER_VIRTUAL
"""
ASKS = ("os.name", "sys.platform", "hasattr(")
"""How a question for the system looks."""
SAVING = {"ImportError", "AttributeError", "ModuleNotFoundError", "Exception"}
ELSEWHERE = {
    ("cosim.fmi.process", "Timers"): "made by _properties on POSIX alone",
    ("cosim.fmi.process", "Limits"): "made by _properties on POSIX alone",
    ("cosim.fmi.process", "_blocked"): "handed out by _properties on POSIX alone",
    ("cosim.fmi.process", "_block"): "handed out by _properties on POSIX alone",
    ("cosim.hardware.loops", "Forked"): "started by the C library of the loop, which is built for Linux alone",
}
"""Functions and classes that are reached under a question which stands elsewhere, and where."""


def needs(node: ast.AST) -> str:
    """What Windows lacks of a node; nothing where there is nothing."""
    if isinstance(node, ast.Import):
        return next((one.name for one in node.names if one.name in MODULES), "")
    if isinstance(node, ast.ImportFrom) and not node.level:
        return node.module if node.module in MODULES else ""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        lacking = {"os": OF_OS, "signal": OF_SIGNAL}.get(node.value.id, "").split()
        return f"{node.value.id}.{node.attr}" if node.attr in lacking else ""
    return ""


def asks(node: ast.AST) -> bool:
    """Whether an expression asks which system this is."""
    return any(word in ast.unparse(node) for word in ASKS)


def saves(node: ast.AST) -> bool:
    """Whether what is missing within a block is caught: `with suppress(ImportError)`, `except AttributeError`."""
    if isinstance(node, ast.With):
        names = {one.id for item in node.items for one in ast.walk(item.context_expr) if isinstance(one, ast.Name)}
        return "suppress" in names and bool(names & SAVING)
    caught = [one.type for one in node.handlers] if isinstance(node, ast.Try) else []
    return any(isinstance(one, ast.Name) and one.id in SAVING for kind in caught if kind for one in ast.walk(kind))


def leaves(node: ast.stmt) -> bool:
    """Whether an `if` about the system ends the function."""
    return isinstance(node, ast.If) and asks(node.test) and isinstance(node.body[-1], ast.Return | ast.Raise)


def bare(node: ast.AST, place: str = "") -> Iterator[tuple[str, str]]:
    """Where something that Windows lacks is reached unasked, and what: the names of the places, the outermost first."""
    if what := needs(node):
        yield place, what
    if saves(node):
        return
    if isinstance(node, ast.If | ast.IfExp) and asks(node.test):
        yield from bare(node.test, place)
        return
    if isinstance(node, ast.BoolOp) and asks(node.values[0]):
        return
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        place = f"{place}.{node.name}".lstrip(".")
    for _, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from bare(child, place)
                if isinstance(child, ast.stmt) and leaves(child):
                    break  # what follows in this block is reached on one kind of system only


def test_what_windows_lacks_is_reached_only_where_the_system_was_asked() -> None:
    """By module and outermost place."""
    reached: dict[tuple[str, str], set[str]] = {}
    for name, path in FILES.items():
        for place, what in bare(ast.parse(path.read_text("utf-8"))) if not name.startswith("cosim_studies") else ():
            reached.setdefault((name, place.partition(".")[0]), set()).add(what)
    assert not {place: what for place, what in reached.items() if place not in ELSEWHERE}
    assert set(ELSEWHERE) <= set(reached), "what is excepted is there"


@pytest.mark.parametrize(
    "text",
    [
        "import fcntl",
        "def f():\n    import resource\n    resource.getrlimit(1)",
        "def f():\n    os.killpg(0, signal.SIGKILL)",
        "def f():\n    with suppress(OSError):\n        os.getuid()",
        "try:\n    import fcntl\nexcept OSError:\n    pass",
        "KILLED = -signal.SIGKILL",
        "if code in (-getattr(signal, 'SIGXCPU', 0), -signal.SIGKILL.value):\n    pass",
    ],
)
def test_what_is_reached_unasked_is_seen(text: str) -> None:
    assert list(bare(ast.parse(text)))


@pytest.mark.parametrize(
    "text",
    [
        "if os.name == 'posix':\n    import fcntl",
        "def f():\n    with suppress(ImportError):\n        import resource",
        "def f():\n    if not hasattr(os, 'getuid'):\n        return\n    os.getuid()",
        "n = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else 1",
        "try:\n    import fcntl\nexcept ImportError:\n    fcntl = None",
        "signal.signal(signal.SIGINT, signal.SIG_IGN)",
    ],
)
def test_what_asks_first_or_is_there_is_let_pass(text: str) -> None:
    assert not list(bare(ast.parse(text)))
