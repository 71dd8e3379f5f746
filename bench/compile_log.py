#!/usr/bin/env python3
"""A wrapper of rustc for `python3 bench features --full`: compiles, and appends the CPU seconds to the file COMPILE_LOG."""

import json
import os
import sys

from running import waited


def main():
    """Runs the compiler with cargo's arguments, and returns its exit code, so that cargo reports failures."""
    words = sys.argv[1:]
    code, usage = waited(words)
    # Cargo gives each compilation of a crate its own suffix.
    own = next((word for word in words if word.startswith("extra-filename=")), None)
    if own and "--crate-name" in words:
        name = words[words.index("--crate-name") + 1]
        line = json.dumps([name + own.removeprefix("extra-filename="), usage.ru_utime + usage.ru_stime])
        with open(os.environ["COMPILE_LOG"], "a") as log:
            log.write(line + "\n")
    sys.exit(code)


if __name__ == "__main__":
    main()
