"""The command `cosim`: verbs that take files to files.

A verb `x` is the function `x` in the module `cosim.cli.x`, or the typer `app` there if it has verbs of its own; other
packages plug in theirs (`cosim.support.plugins`). Only the module of the verb that is called is imported, and it
imports what is heavy inside its functions: so a run needs neither CasADi nor a compiler.

Exit codes: 0 done, 1 only where a yes or no was asked, 2 wrong use or bad input (one sentence), 130 interrupted (143 by
SIGTERM).
"""

import errno
import functools
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, NoReturn

import typer

from cosim.cli.help import epilog, group_of
from cosim.cli.settings import PAIRS, Settings, read_settings
from cosim.cli.verbs import modules, verbs
from cosim.support.errors import CosimError, InputError, PlugInError
from cosim.support.interrupts import Terminated, end_well, is_interrupted, is_terminated
from cosim.support.suffixes import recordings
from cosim.support.system_errors import surroundings
from cosim.support.terminal import abandon_stdout, finish_stdout, keep_stdout, put, say, say_once_begun
from cosim.support.threads import VARIABLES
from cosim.support.version import __version__
from pyfmi_models.errors import ModelError

SEVERAL = ("--columns", "--units", "--layout", "--variables", "--limits", "--set", "--bounds")
"""Options that may be followed by several name=value pairs."""
NAMES = ("--free",)
"""Options that may be followed by several names, up to the next option or file."""
INTERRUPTED, TERMINATED = 130, 143
"""Exit codes."""
NONE = Settings()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given
    try:
        end_well()
        say_once_begun()
        keep_stdout()
        set_libraries()
        check_given(given)
        settings = settled()
        rest = repeated(plugged([argument for argument in given if argument != "--debug"], settings.paths))
        application(rest, debug, settings)(rest, prog_name="cosim")
    except KeyboardInterrupt as error:  # while a verb was loaded, or after it had ended
        if debug:
            raise
        leave(error)
    except SystemExit as ended:  # before its verb began: typer takes each signal for Ctrl-C
        if ended.code == INTERRUPTED and is_terminated():
            leave(Terminated())
        raise
    except PlugInError as error:
        if debug:
            raise
        say(f"cosim: {error}")
        sys.exit(2)
    except Exception as error:  # as a verb was loaded
        if debug or not is_of_signal(error):
            raise
        leave(signalled())


def set_libraries() -> None:
    """Tell libraries what suits a command, unless the environment says otherwise; before they are loaded.

    Linear algebra works in one thread: matrices here are small, and a second thread makes a diagnosis no faster and
    takes a third more of the processor. Pydantic looks for no plug-ins of its own among all packages: that is a
    fortieth of a short run.
    """
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    for name in VARIABLES:
        os.environ.setdefault(name, "1")


def check_given(arguments: Sequence[str]) -> None:
    """Refuse an empty argument: as a path it would be the folder that one stands in. Its sentence ends the command."""
    for before, argument in zip(("cosim", *arguments), arguments, strict=False):
        option, assigned, value = argument.partition("=")
        name, text = (option, value) if assigned and option.startswith("--") else (before, argument)
        if not text.strip():
            say(f'cosim: {name} "{text}": it must not be empty; write "." for the folder that you are in.')
            sys.exit(2)


def settled() -> Settings:
    """Read the defaults of the folder that one stands in; what is wrong with them ends the command in a sentence."""
    try:
        found = read_settings(verbs)
    except InputError as error:
        say(f"cosim: {error}")
        sys.exit(2)
    if "out" in found.paths:
        os.environ["COSIM_OUT"] = found.paths["out"]
    return found


def plugged(arguments: Sequence[str], paths: Mapping[str, str] = MappingProxyType({})) -> list[str]:
    """Take `--plugins DIR` out of the arguments, wherever it is, and put the folder where plugins are looked for."""
    rest, folders, values = [], [], iter(arguments)
    if "plugins" in paths and "--plugins" not in {argument.partition("=")[0] for argument in arguments}:
        values = iter([*arguments, "--plugins", paths["plugins"]])
    for argument in values:
        option, assigned, value = argument.partition("=")
        if option != "--plugins":
            rest.append(argument)
            continue
        value = value if assigned else next(values, "")
        if not os.path.isdir(value):
            what = "is a file, not a folder" if os.path.exists(value) else "there is no such folder"
            say(f"cosim: --plugins {value}: {what}; it must be a folder of Python files with laws or effects.")
            sys.exit(2)
        folders.append(os.path.abspath(value))
    known = filter(None, os.environ.get("COSIM_PLUGINS", "").split(os.pathsep))
    if folders:
        os.environ["COSIM_PLUGINS"] = os.pathsep.join(dict.fromkeys([*known, *folders]))
    return rest


def leave(error: KeyboardInterrupt) -> NoReturn:
    """Say that a signal ended the command, and leave with its exit code."""
    ended = isinstance(error, Terminated)
    say(f"cosim: {'terminated' if ended else 'interrupted'}")
    sys.exit(TERMINATED if ended else INTERRUPTED)


def repeated(arguments: Sequence[str]) -> list[str]:
    """Let `--columns a=b c=d` (`SEVERAL`) and `--free a b` (`NAMES`) take several values: repeat the option."""
    out: list[str] = []
    option = ""
    for argument in arguments:
        if argument.startswith("-"):
            option = argument if argument in (*SEVERAL, *NAMES) else ""
        elif option and out[-1] != option:
            if "=" in argument if option in SEVERAL else not is_file(argument):
                out.append(option)
            else:
                option = ""
        out.append(argument)
    return out


def is_file(argument: str) -> bool:
    """Whether an argument names a file: one that is there, in a folder, or with the suffix of a recording."""
    path = argument.partition(":")[0]
    return os.path.exists(path) or os.sep in argument or path.lower().endswith(recordings())


def application(arguments: Sequence[str], debug: bool = False, settings: Settings = NONE) -> typer.Typer:
    """Make the command with the verb that is called, or with all that there are."""
    called = next((argument for argument in arguments if not argument.startswith("-")), "")
    found = dict(modules(called))
    app = typer.Typer(
        name="cosim",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={
            "help_option_names": ["-h", "--help"],
            "default_map": {verb: settings.of_verb(verb) for verb in found},
        },
    )
    app.callback()(_options)
    for verb, module in found.items():
        group, examples = group_of(verb, module), epilog(verb, module)
        if isinstance(getattr(module, "app", None), typer.Typer):
            for command in module.app.registered_commands:
                command.callback = guarded(command.callback, debug) if command.callback else None
            app.add_typer(module.app, name=verb, rich_help_panel=group, epilog=examples)
        else:
            command = app.command(verb, rich_help_panel=group, epilog=examples)
            command(guarded(getattr(module, verb), debug, settings))
    return app


def guarded(verb: Callable[..., Any], debug: bool, settings: Settings = NONE) -> Callable[..., Any]:
    """Turn what this project raises on purpose, and what the system refuses, into one sentence; Ctrl-C into 130."""

    @functools.wraps(verb)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            check_finite(kwargs)
            settings.check(verb.__name__, tuple(kwargs))
            for name in PAIRS:
                if name in kwargs and (known := settings.listed(name)):
                    kwargs[name] = [*known, *(kwargs[name] or [])]
            done = verb(*args, **kwargs)
            finish_stdout()
            return done
        except (CosimError, ModelError) as error:
            if debug:
                raise
            say(f"cosim: {error}")
            sys.exit(2)
        except (OSError, MemoryError) as error:
            if debug or (isinstance(error, OSError) and error.errno == errno.EPIPE):
                raise
            abandon_stdout()
            if is_interrupted() and getattr(error, "errno", 0) == errno.EBADF:  # a file closed twice, as by `rmtree`
                leave(signalled())
            say(f"cosim: {surroundings(error)}")
            sys.exit(2)
        except KeyboardInterrupt as error:
            if debug:
                raise
            leave(error)
        except Exception as error:
            if debug or not is_of_signal(error):
                raise
            leave(signalled())

    return call


def is_of_signal(error: BaseException) -> bool:
    """Whether an error is what a C extension makes of a signal that comes while it works or is loaded."""
    return is_interrupted() or isinstance(error.__cause__ or error.__context__, KeyboardInterrupt)


def signalled() -> KeyboardInterrupt:
    """The signal that this process was sent."""
    return Terminated() if is_terminated() else KeyboardInterrupt()


def check_finite(options: Mapping[str, object]) -> None:
    """Refuse numbers of the command line that are none: no bound of an option holds back `nan`.

    Raises:
        InputError: names the option.
    """
    for name, value in options.items():
        if isinstance(value, float) and not isfinite(value):
            option = f"--{name.replace('_', '-')}"
            raise InputError(f"{option} {value}: it must be a finite number.", culprit=option, value=value)


def _version(wanted: bool) -> None:
    if wanted:
        put(f"mount-cosim {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", "-V", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
    plugins: Annotated[
        Path | None, typer.Option("--plugins", help="Folder of your own laws and effects; may be anywhere.")
    ] = None,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks; may be anywhere.")] = False,
) -> None:
    """Co-simulation of a telescope mount that finds missing physics in the model."""
