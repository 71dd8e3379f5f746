#!/usr/bin/env python3
"""What each part of `render2mpeg` costs, as a Markdown table: crates, CPU seconds of the compiler, and what it all weighs.

Run from the repository's root: tests/feature_costs.py [FOLDER FOR THE BUILDS, target-features]

Two builds are made, with everything and with the command line alone, optimised as for release. The first tells what each crate took to
compile: seconds of the compiler's processes (user and system), which do not depend on what else the machine does. The
seconds of a feature are those of the crates that only it brings; the program's own part comes on top, for all features
together. Sizes are of stripped binaries.
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


def build(options, folder):
    """Builds; by package, the units that were compiled for it, and the program's path."""
    command = ["cargo", "build", "--release", "--package", "render2mpeg", "--bin", "render2mpeg", *options]
    command += ["--message-format", "json", "--target-dir", str(folder)]
    environment = dict(os.environ, RUSTC_WRAPPER=str(Path(__file__).resolve()), COMPILE_LOG=str(folder / "compile.log"))
    environment["CARGO_PROFILE_RELEASE_DEBUG"] = "false"
    output = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True).stdout
    units, binary = {}, None
    for message in map(json.loads, output.splitlines()):
        if message["reason"] != "compiler-artifact":
            continue
        binary = message["executable"] or binary
        own = units.setdefault(package_of(message["package_id"]), set())
        for path in map(Path, message["filenames"]):
            if path.name == "build-script-build":
                own.add("build_script_build-" + path.parent.name.split("-")[-1])
            own.add(path.name.removeprefix("lib").split(".")[0])
    return units, Path(binary)


def package_of(identity):
    """Name and version of a package, as cargo tree has them: "registry+…#name@1.2.3", "path+…/name#1.2.3"."""
    place, _, name = identity.rpartition("#")
    name, _, version = name.rpartition("@")
    return f"{name or Path(place).name} v{version}"


def packages(options):
    """What a build consists of."""
    command = ["cargo", "tree", "--package", "render2mpeg", "--edges", "normal,build", "--prefix", "none", "--no-dedupe"]
    output = subprocess.run([*command, *options], stdout=subprocess.PIPE, check=True, text=True).stdout
    return {" ".join(line.split()[:2]) for line in output.splitlines() if line}


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "target-features").resolve()
    if folder.exists():
        sys.exit(f"{folder} exists: remove it, so that every crate is compiled, or name another folder")
    folder.mkdir(parents=True)
    nothing = ["--no-default-features", "--features", "command-line"]
    rows = {}
    for name, options in [("all", []), ("none", nothing)]:
        units, binary = build(options, folder)
        log = (folder / "compile.log").read_text().splitlines()
        seconds = dict(map(json.loads, log))
        # The program itself is named without its hash among the units: it is the last of its name.
        program = [took for unit, took in seconds.items() if unit.startswith("render2mpeg-")][-1]
        whole = program + sum(seconds.get(unit, 0) for own in units.values() for unit in own)
        rows[name] = (len(packages(options)), whole, len(stripped(binary, folder)))
        if name == "all":
            took = {package: sum(seconds.get(unit, 0) for unit in own) for package, own in units.items()}
    base = packages(nothing)
    line = "| {} | {} | {} | {:.0f} s | {} |"
    print("| Feature | adds | crates | compiling them | binary |\n|---|---|---|---|---|")
    print(line.format("`command-line`", "`render`, `plan`", rows["none"][0], rows["none"][1], f"{rows['none'][2] / 1e6:.1f} MB"))
    for name, about in PARTS.items():
        brought = packages(["--no-default-features", "--features", f"command-line,{name}"]) - base
        compiling = sum(took.get(package, 0) for package in brought)
        print(line.format(f"`{name}`", about, f"+{len(brought)}", compiling, ""))
    print(line.format("all, the default", "", rows["all"][0], rows["all"][1], f"{rows['all'][2] / 1e6:.1f} MB"))


def stripped(binary, folder):
    """The bytes of the program without symbols."""
    path = folder / "stripped"
    subprocess.run(["strip", "-o", str(path), str(binary)], check=True)
    return path.read_bytes()


if __name__ == "__main__":
    compile_and_note() if "COMPILE_LOG" in os.environ else main()
