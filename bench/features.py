"""Cost of each Cargo feature of render2mpeg: crates, CPU seconds of the compiler, size of the program.

    python3 bench features [--quick]
    python3 bench features --full [--folder FOLDER]

Quick builds nothing and counts the dependencies with `cargo tree`.

Full makes two release builds, with the default features and with none. The first measures the compilation of each
crate in CPU seconds of the compiler's processes, which depend little on other load. The seconds of a feature are the sum over
the crates that only this feature adds. The program's own crates are a separate sum for all features together.
Sizes are of programs without symbols.
"""

import json
import os
from pathlib import Path

import tables
from running import ROOT, Failure, need_installed, run

# Measured features: name, and their description in the table.
PARTS = {
    "textures": "PNG and JPEG on surfaces, skies from `.hdr` files",
    "webp": "WebP on surfaces",
    "basis": "KTX2 on surfaces",
    "meshopt": "meshes packed by meshoptimizer",
    "draco": "meshes packed by Draco",
    "bake": "`bake`, `--lighting baked`",
}
EVERYTHING = []
NOTHING = ["--no-default-features"]


def add_options(parser):
    """Adds the options of this measurement."""
    place = ROOT / "target-features"
    parser.add_argument("--folder", type=Path, default=place, help="full: folder for the builds [default: target-features]")


def with_part(name):
    """Returns cargo's options for a build with one feature."""
    return ["--no-default-features", "--features", name]


def packages(options):
    """Returns the dependencies of a build."""
    command = ["cargo", "tree", "--package", "render2mpeg-cli", "--edges", "normal,build", "--prefix", "none", "--no-dedupe"]
    output = run([*command, *options], folder=ROOT).output
    # Crates of this workspace appear with their folders.
    return {" ".join(line.split()[:2]) for line in output.splitlines() if line and f"({ROOT}" not in line}


def package_of(identity):
    """Returns name and version of a package as in cargo tree: "registry+…#name@1.2.3", "path+…/name#1.2.3"."""
    place, _, name = identity.rpartition("#")
    name, _, version = name.rpartition("@")
    return f"{name or Path(place).name} v{version}"


def build(options, folder):
    """Builds the program. Returns its compiled units by package, and its path."""
    command = ["cargo", "build", "--release", "--package", "render2mpeg-cli", "--bin", "render2mpeg", *options]
    command += ["--message-format", "json", "--target-dir", folder]
    wrapper = Path(__file__).resolve().parent / "compile_log.py"
    environment = dict(os.environ, RUSTC_WRAPPER=str(wrapper), COMPILE_LOG=str(folder / "compile.log"))
    environment["CARGO_PROFILE_RELEASE_DEBUG"] = "false"
    units, binary = {}, None
    for message in map(json.loads, run(command, folder=ROOT, environment=environment).output.splitlines()):
        if message["reason"] != "compiler-artifact":
            continue
        binary = message["executable"] or binary
        units.setdefault(package_of(message["package_id"]), set()).update(units_of(message))
    return units, Path(binary)


def units_of(message):
    """Returns the names in the log of the units that a message of cargo describes."""
    for path in map(Path, message["filenames"]):
        if path.name == "build-script-build":
            yield "build_script_build-" + path.parent.name.split("-")[-1]
        yield path.name.removeprefix("lib").split(".")[0]


def stripped_size(binary, folder):
    """Returns the size of the program without symbols [bytes]."""
    path = folder / "stripped"
    run(["strip", "-o", path, binary])
    return path.stat().st_size


def measured(options, folder):
    """Measures a build: the compiler's seconds by package, their total, and the program's size as text."""
    units, binary = build(options, folder)
    seconds = dict(map(json.loads, (folder / "compile.log").read_text().splitlines()))
    by_package = {package: sum(seconds.get(unit, 0) for unit in own) for package, own in units.items()}
    # The list of units contains no hash of the program. The program is the last unit with its name.
    program = [took for unit, took in seconds.items() if unit.startswith("render2mpeg-")][-1]
    whole = program + sum(by_package.values())
    return by_package, f"{whole:.0f} s", f"{stripped_size(binary, folder) / 1e6:.1f} MB"


def full(folder):
    """Prints the table with compile times and sizes."""
    folder = folder.resolve()
    if folder.exists():
        raise Failure(f"{folder} exists: remove it, so that every crate is compiled, or name another with --folder")
    need_installed("strip")
    folder.mkdir(parents=True)
    took, *all_figures = measured(EVERYTHING, folder)
    _, *base_figures = measured(NOTHING, folder)
    base = packages(NOTHING)
    rows = [["none", "all commands except `bake`", len(base), *base_figures]]
    for name, about in PARTS.items():
        brought = packages(with_part(name)) - base
        compiling = sum(took.get(package, 0) for package in brought)
        rows.append([f"`{name}`", about, f"+{len(brought)}", f"{compiling:.0f} s", ""])
    rows.append(["all, the default", "", len(packages(EVERYTHING)), *all_figures])
    print(tables.table(["Feature", "adds", "dependencies", "compiling these", "program"], rows))


def quick():
    """Prints the table of crates only."""
    base = packages(NOTHING)
    rows = [["none", "all commands except `bake`", len(base)]]
    rows += [[f"`{name}`", about, f"+{len(packages(with_part(name)) - base)}"] for name, about in PARTS.items()]
    rows.append(["all, the default", "", len(packages(EVERYTHING))])
    print(tables.table(["Feature", "adds", "dependencies"], rows))
    print("\nCounts are exact. Nothing was built.")
    print("`--full` builds twice for compile times and sizes.")


def main(options):
    """Prints the quick or the full table."""
    need_installed("cargo")
    full(options.folder) if options.full else quick()
