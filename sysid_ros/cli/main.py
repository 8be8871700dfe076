"""The command ``sysid``: a group that imports a sub-command only when it is called, so that ``--help`` is immediate."""

from __future__ import annotations

import gc
import importlib
import logging
import os
import signal
import sys
import warnings
from collections.abc import Sequence

import click

from sysid_ros import __version__
from sysid_ros.exceptions import SysidError

COMMANDS = {
    "demo": ("sysid_ros.cli.demo", "Watch a payload being estimated live, on a simulated robot."),
    "replay": ("sysid_ros.cli.replay", "Estimate the payload from a bag, as the node does live."),
    "identify": ("sysid_ros.cli.identify", "Identify the arm's own dynamics from bags without a payload."),
    "simulate": ("sysid_ros.cli.simulate", "Record a bag of a simulated robot, with the truth beside it."),
    "excite": ("sysid_ros.cli.excite", "Find the motion that tells most about an arm."),
    "diagnose": ("sysid_ros.cli.diagnose", "Find what a robot's model gets wrong, why, and what it costs."),
    "frequency": ("sysid_ros.cli.frequency", "Up to what frequency a model holds, and what it misses beyond."),
    "export": ("sysid_ros.cli.export", "Write an identified model for a simulator."),
    "doctor": ("sysid_ros.cli.doctor", "What is installed, what works, what to do."),
    "batch": ("sysid_ros.cli.batch", "The same jobs on the bags of a whole fleet, into one store."),
    "control": ("sysid_ros.cli.control", "Compare control laws on an arm that picks up an unknown payload."),
}
"""Name of each sub-command: the module that exposes it as ``command``, and the sentence of the overview."""

DONE = 0
BAD_INPUT = 2
INTERRUPTED = 130
TERMINATED = 143
READER_GONE = 141


class LazyGroup(click.Group):
    """A click group over a table of names, modules and sentences; nothing is imported to show the overview.

    Args:
        commands: name of each sub-command to (module that exposes ``command``, one sentence).
    """

    def __init__(self, *, table: dict[str, tuple[str, str]], **attributes: object) -> None:
        super().__init__(**attributes)  # type: ignore[arg-type]
        self._table = table

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the table."""
        return list(self._table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """The sub-command, imported now.

        Raises:
            click.UsageError: there is no such sub-command.
        """
        if cmd_name not in self._table:
            ctx.fail(f"There is no command {cmd_name!r}. The commands are {', '.join(self._table)}.")
        command: click.Command = importlib.import_module(self._table[cmd_name][0]).command
        return command

    def invoke(self, ctx: click.Context) -> object:
        """Runs the sub-command; a reader of its output that has gone (``| head``) ends it without a word."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            return _reader_gone()

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Writes the overview from the table."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, sentence) for name, (_, sentence) in self._table.items()])


@click.command(
    cls=LazyGroup,
    table=COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 done; 1 done, and the answer is no where the command asks a question; 2 bad input or usage.",
)
@click.version_option(__version__, package_name="sysid_ros", prog_name="sysid")
def sysid() -> None:
    """Payload and dynamics of a robot from what it measures.

    \b
    Example:
      sysid replay pick_and_drop.mcap --json estimate.json --plot estimate.png
    """


def run(arguments: Sequence[str] | None = None) -> int:
    """Runs ``sysid`` with ``arguments``, or those of the process, and returns the exit code.

    A sub-command returns nothing, or an integer that becomes the exit code. A mistake of the user is one message on stderr,
    without a traceback.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        result = sysid.main(args=given, prog_name="sysid", standalone_mode=False, obj=given)
    except click.ClickException as error:
        error.show()
        return BAD_INPUT
    except (click.Abort, KeyboardInterrupt):
        click.echo("Interrupted.", err=True)
        return INTERRUPTED
    except SysidError as error:
        click.echo(f"Error: {error}", err=True)
        return BAD_INPUT
    except OSError as error:
        where = "standard output" if error.filename is None else os.fsdecode(error.filename)
        click.echo(f"Error: {where}: {error.strerror or error}.", err=True)
        return BAD_INPUT
    return result if isinstance(result, int) else DONE


def _reader_gone() -> int:
    """As a tool that SIGPIPE ends, for a shell; nothing is left to be flushed at the end of the process."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return READER_GONE


def main() -> None:
    """Entry point of the console script ``sysid``."""
    # A stream of measurements makes many small objects and no cycles: looking for those less often saves a tenth of the time.
    gc.set_threshold(100_000, 50, 1000)
    # The matrices are small: more threads of BLAS only wait for each other. It counts the first time that numpy is imported.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # What is said about a result is said in words; a library's own warnings tell of its inside.
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
        logging.getLogger("matplotlib").setLevel(logging.ERROR)  # that it builds its cache of fonts
    # An exception, so that what is half written is taken away.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    _require_streams()
    code = run()
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        code = _reader_gone()
    except OSError as error:
        click.echo(f"Error: standard output: {error.strerror}.", err=True)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = BAD_INPUT
    sys.exit(code)


def _require_streams() -> None:
    """Somewhere to write to also where a stream is closed (``>&-``), and no character that it can't take."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        getattr(sys, name).reconfigure(errors="replace")


if __name__ == "__main__":
    main()
