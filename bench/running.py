"""Programs: their paths, their execution, and their CPU seconds."""

import os
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Cargo's folder of release builds.
RELEASE = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve() / "release"


class Failure(Exception):
    """A failure to report to the user in one line."""


@dataclass
class Finished:
    """A successful run: standard output, and CPU seconds (user and system) of the program and its children."""

    output: str
    cpu: float


def run(command, stdin=None, capture=True, folder=None, environment=None):
    """Runs a program to its end. `stdin` is the path of a file; without `capture`, the user sees the output."""
    command = [str(word) for word in command]
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        streams = {"stdout": output, "stderr": errors} if capture else {}
        with open(stdin or os.devnull, "rb") as source:
            code, usage = waited(command, stdin=source, cwd=folder, env=environment, **streams)
        texts = [read_again(stream) for stream in (output, errors)]
    if code != 0:
        last = (texts[1].strip().splitlines() or ["no message"])[-1]
        raise Failure(f"{shlex.join(command)} failed with code {code}: {last}")
    return Finished(texts[0], usage.ru_utime + usage.ru_stime)


def waited(command, **settings):
    """Runs a program, and returns its exit code and resource usage."""
    try:
        process = subprocess.Popen(command, **settings)
    except OSError as error:
        raise Failure(f"{command[0]} cannot be started: {error.strerror}") from None
    try:
        _, status, usage = os.wait4(process.pid, 0)
    except BaseException:
        process.kill()
        process.wait()
        raise
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage


def read_again(stream):
    """Returns the whole text of a file after it was written."""
    stream.seek(0)
    return stream.read().decode(errors="replace")


def own_cpu(work):
    """Returns the result of `work`, and its CPU seconds in this process."""
    begin = resource.getrusage(resource.RUSAGE_SELF)
    value = work()
    end = resource.getrusage(resource.RUSAGE_SELF)
    return value, end.ru_utime + end.ru_stime - begin.ru_utime - begin.ru_stime


def add_program(parser):
    """Adds the option that selects the measured program."""
    place = RELEASE / "render2mpeg"
    parser.add_argument("--program", type=Path, default=place, help="the measured program, target/release/render2mpeg")


def built(path, build):
    """Returns the absolute path of a program of this project; a missing one is built first, with a message."""
    if not Path(path).is_file():
        print(f"building a program, once, beside the time of the measurement: {build}", file=sys.stderr, flush=True)
        run(build.split(), capture=False, folder=ROOT)
    return need_built(path, build)


def need_built(path, build):
    """Returns the absolute path of a program built by cargo; a missing one fails with the build command."""
    if not Path(path).is_file():
        raise Failure(f"{path} is missing; build it: {build}")
    return Path(path).resolve()


def built_program(options):
    """Returns the path of the measured program. The default program is built if it is missing."""
    default = options.program == RELEASE / "render2mpeg"
    return built(options.program, "cargo build --release") if default else need_program(options)


def need_program(options):
    """Returns the path of the measured program."""
    return need_built(options.program, "cargo build --release")


def need_files(paths):
    """Checks that the user's files exist."""
    for path in paths:
        if not Path(path).is_file():
            raise Failure(f"{path} is missing")


def need_installed(name):
    """Checks that a program of the system is installed."""
    if shutil.which(name) is None:
        raise Failure(f"{name} is missing; install it, such as by apt-get install {name}")
