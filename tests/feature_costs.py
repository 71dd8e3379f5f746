#!/usr/bin/env python3
"""What each part of `render2mpeg` costs: CPU seconds of the compiler, crates, and bytes of the binary, as a Markdown table.

Run from the repository's root: tests/feature_costs.py [FOLDER FOR THE BUILDS, target-features]

Builds are optimised as for release and share a folder, so that no crate is compiled twice alike; the seconds of a build
are those of all the crates that it consists of, as if it had begun with nothing. Seconds are those of the compiler's
processes (user and system), which do not depend on what else the machine does; sizes are of stripped binaries.
"""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

# Features that are measured: name, and what the table says they add.
PARTS = {
    "textures": "PNG and JPEG on surfaces, skies from `.hdr` files",
    "exr": "`--exr`, `--aov`, `reference`, skies from `.exr` files",
    "compare": "`compare`, with SSIMULACRA 2",
    "html": "`render --html`",
    "sweep": "`sweep`; brings `compare`, `exr` and `html`",
    "trace": "`-v`, `--trace`",
    "shell": "`completions`, `man`",
}


def compile_and_note():
    """As cargo's RUSTC_WRAPPER: compiles, and appends what that took to the log."""
    code = subprocess.call(sys.argv[1:])
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = sys.argv[1:]
    # Cargo gives each way of compiling a crate a name of its own.
    own = next((word for word in words if word.startswith("extra-filename=")), None)
    if own and "--crate-name" in words:
        name = words[words.index("--crate-name") + 1]
        line = json.dumps([name + own.removeprefix("extra-filename="), usage.ru_utime + usage.ru_stime])
        with open(os.environ["COMPILE_LOG"], "a") as log:
            log.write(line + "\n")
    sys.exit(code)


def build(features, folder):
    """Builds; names of the units that the binary consists of, and its path."""
    command = ["cargo", "build", "--release", "--package", "pipeline", "--bin", "render2mpeg"]
    command += ["--message-format", "json", "--target-dir", str(folder)]
    if features is not None:
        command += ["--no-default-features", "--features", ",".join(features)]
    environment = dict(os.environ, RUSTC_WRAPPER=str(Path(__file__).resolve()), COMPILE_LOG=str(folder / "compile.log"))
    environment["CARGO_PROFILE_RELEASE_DEBUG"] = "false"
    output = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True).stdout
    units, binary = set(), None
    for message in map(json.loads, output.splitlines()):
        if message["reason"] != "compiler-artifact":
            continue
        binary = message["executable"] or binary
        for path in message["filenames"]:
            path = Path(path)
            if path.name == "build-script-build":
                units.add("build_script_build-" + path.parent.name.split("-")[-1])
            units.add(path.name.removeprefix("lib").split(".")[0])
    return units, Path(binary)


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "target-features").resolve()
    if folder.exists():
        sys.exit(f"{folder} exists: remove it, so that every crate is compiled, or name another folder")
    folder.mkdir(parents=True)
    builds = {"all": None, "none": []} | {name: [name] for name in PARTS}
    found = {}
    for name, features in builds.items():
        units, binary = build(features, folder)
        size = len(stripped(binary, folder))
        log = (folder / "compile.log").read_text().splitlines()
        seconds = dict(map(json.loads, log))
        # The binary itself is named without its hash: it is the last of its name.
        known = [unit for unit in units if unit in seconds]
        own = [seconds[unit] for unit in seconds if unit.startswith("render2mpeg-")][-1:]
        found[name] = (sum(seconds[unit] for unit in known) + sum(own), len(known), size)
        print(name, found[name], file=sys.stderr)
    base = found["none"]
    print("| Feature | adds | CPU s of the compiler | crates | binary |\n|---|---|---|---|---|")
    print(f"| none | `render`, `plan` | {base[0]:.0f} | {base[1]} | {base[2] / 1e6:.1f} MB |")
    for name, about in PARTS.items():
        seconds, crates, size = (a - b for a, b in zip(found[name], base))
        print(f"| `{name}` | {about} | {seconds:+.0f} | {crates:+d} | {size / 1e6:+.1f} MB |")
    everything = found["all"]
    print(f"| all, the default | | {everything[0]:.0f} | {everything[1]} | {everything[2] / 1e6:.1f} MB |")


def stripped(binary, folder):
    """The bytes of the program without symbols."""
    path = folder / "stripped"
    subprocess.run(["strip", "-o", str(path), str(binary)], check=True)
    return path.read_bytes()


if __name__ == "__main__":
    compile_and_note() if "COMPILE_LOG" in os.environ else main()
