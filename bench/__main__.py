"""Measurements of render2mpeg: python3 bench coupling|error|sweep|encoders|features|bits|importance|joints|rates|gltf|fidelity|models|peers [--quick|--full] [options].

Quick, the default, takes about five minutes of CPU time and reports the reliability of its figures.
Full makes the tables of the documentation; for bits, larger films.
README.md in this folder describes each measurement.
"""

import argparse
import signal
import sys

import bits
import coupling
import encoders
import error
import features
import fidelity
import gltf
import importance
import joints
import models
import peers
import rates
import sweep
from running import Failure

MEASUREMENTS = {
    "coupling": coupling,
    "error": error,
    "sweep": sweep,
    "encoders": encoders,
    "features": features,
    "bits": bits,
    "importance": importance,
    "joints": joints,
    "rates": rates,
    "gltf": gltf,
    "fidelity": fidelity,
    "models": models,
    "peers": peers,
}


def parser():
    """Returns the command line: one subcommand for each measurement."""
    style = argparse.RawDescriptionHelpFormatter
    whole = argparse.ArgumentParser(prog="python3 bench", description=__doc__, formatter_class=style)
    commands = whole.add_subparsers(dest="measurement", required=True, metavar="MEASUREMENT")
    for name, module in MEASUREMENTS.items():
        summary = module.__doc__.splitlines()[0].replace("%", "%%")
        command = commands.add_parser(name, help=summary, description=module.__doc__, formatter_class=style)
        extent = command.add_mutually_exclusive_group()
        extent.add_argument("--quick", action="store_true", help="an answer in about five minutes of CPU time, the default")
        extent.add_argument("--full", action="store_true", help="the tables of the documentation, or larger films")
        module.add_options(command)
    return whole


def main():
    """Runs a measurement; reports a missing tool in one line."""
    # End silently if the reader of the tables closes its pipe.
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    options = parser().parse_args()
    try:
        MEASUREMENTS[options.measurement].main(options)
    except Failure as failure:
        sys.exit(f"bench: {failure}")
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
