"""Files of the glTF-Render-Fidelity page: scenarios, models, environments and goldens, copied from git repositories to a cache.

The repositories are subfolders of one folder: clones named NAME or OWNER+NAME, bare or with work tree. All are optional;
each file comes from the first repository that contains it. Pointers of git LFS count as missing.
"""

import json
import os
import posixpath
import subprocess
from pathlib import Path

from fidelity_scene import files_of, read_gltf
from running import Failure

# Page with goldens, 512 pixels wide.
PAGE = "KhronosGroup/glTF-Render-Fidelity"
# Generators with config.json and environments, in order of preference. The fork has the scenarios of the page's goldens.
GENERATORS = ("BruceCherniak/glTF-Render-Fidelity", "KhronosGroup/glTF-Render-Fidelity-Generator")
# Models, and their folder in the repository.
MODELS = {
    "KhronosGroup/glTF-Sample-Assets": "Models",
    "DRx3D/glTF-Sample-Assets-OLD": "Models",
    "KhronosGroup/glTF-Sample-Models": "2.0",
    "ux3d/glTF-Sample-Models": "2.0",
    "sbtron/glTF-Sample-Models": "2.0",
}
# Variants of a model with the same materials, in order of preference after the scenario's own.
VARIANTS = ("glTF-Binary", "glTF", "glTF-Embedded", "glTF-Quantized", "glTF-Draco", "glTF-KTX-BasisU", "glTF-KTX2-Basisu")
GOLDENS = "public/thumbnails/goldens"
LFS_POINTER = b"version https://git-lfs"


def cache_folder():
    """Returns the default folder of the cache."""
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "render2mpeg" / "fidelity"


class Repository:
    """The newest commit of a git repository."""

    def __init__(self, directory):
        self.directory = directory
        listing = self.git("ls-tree", "-r", "-z", "HEAD").split(b"\0")
        # Each line is "mode type hash\tpath".
        lines = (line.split(b"\t", 1) for line in listing if line)
        self.blobs = {path.decode(): words.split()[2].decode() for words, path in lines}

    def git(self, *words):
        done = subprocess.run(["git", f"--git-dir={self.directory}", *words], capture_output=True, check=False)
        if done.returncode != 0:
            raise Failure(f"git cannot read {self.directory}: {done.stderr.decode(errors='replace').strip()}")
        return done.stdout

    def read(self, path):
        """Returns the content of a file, or None if the repository lacks it."""
        blob = self.blobs.get(path)
        try:
            data = blob and self.git("cat-file", "blob", blob)
        except Failure:
            return None
        return None if not data or data.startswith(LFS_POINTER) else data


def git_directory(sources, name):
    """Returns the git directory of a repository OWNER/NAME below `sources`, or None."""
    owner, short = name.split("/")
    for folder in (sources / f"{owner}+{short}" / "repo", sources / f"{owner}+{short}", sources / short):
        for directory in (folder / ".git", folder):
            if (directory / "HEAD").is_file():
                return directory
    return None


class Files:
    """Scenarios, models, environments and goldens."""

    def __init__(self, sources, cache):
        self.cache = cache
        names = [PAGE, *GENERATORS, *MODELS]
        found = {name: git_directory(sources, name) for name in names}
        self.repositories = {name: Repository(directory) for name, directory in found.items() if directory}
        # A fork may share the name of the page's repository, so contents decide.
        self.page = self.repositories.get(PAGE)
        if self.page is None:
            raise Failure(f"{PAGE} is missing; git clone https://github.com/{PAGE} {sources / PAGE.split('/')[1]}")
        self.generators = [self.repositories[name] for name in GENERATORS if name in self.repositories]
        self.models = [(self.repositories[name], base) for name, base in MODELS.items() if name in self.repositories]

    def scenarios(self, config=None):
        """Returns the scenarios of a config.json: a file of the user, or that of the first generator."""
        texts = [Path(config).read_bytes()] if config else [one.read("test/config.json") for one in self.generators]
        for text in filter(None, texts):
            return json.loads(text)["scenarios"]
        raise Failure(f"test/config.json is missing; git clone {GENERATORS[1]} or {GENERATORS[0]}, or give --config FILE")

    def goldens(self):
        """Returns the paths of the goldens by scenario and renderer."""
        found = {}
        for path in self.page.blobs:
            if path.startswith(GOLDENS + "/") and path.endswith("-golden.thumb.webp"):
                _, scenario, name = path.rsplit("/", 2)
                found.setdefault(scenario, {})[name.removesuffix("-golden.thumb.webp")] = path
        return found

    def golden(self, path):
        """Copies a golden to the cache and returns its path."""
        return self.kept("goldens/" + path.removeprefix(GOLDENS + "/"), [(self.page, path)])

    def kept(self, name, places):
        """Copies a file from the first of `places` (repository, path) to the cache, and returns its path, or None."""
        file = self.cache / name
        if file.is_file():
            return file
        for repository, path in places:
            data = repository.read(path)
            if data:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(data)
                return file
        return None

    def environment(self, lighting):
        """Returns the path of a scenario's environment in the cache, or None."""
        name = posixpath.basename(lighting)
        places = [(one, path) for one in self.generators for path in one.blobs if posixpath.basename(path) == name]
        return self.kept(f"environments/{name}", places)

    def model(self, path):
        """Returns the path of a scenario's model in the cache, or None, and a remark.

        Without a complete copy of the scenario's own file, the remark names another variant or the missing files.
        """
        name, own = path.split("/Models/")[1].split("/", 1)
        kind = own.split("/")[0]
        missing = {}
        for variant in (kind, *(other for other in VARIANTS if other != kind)):
            for repository, base in self.models:
                for main in self.mains(repository, f"{base}/{name}/{variant}/"):
                    file, lacking = self.whole(repository, main, base)
                    if file:
                        return file, "" if variant == kind else variant
                    missing.setdefault(variant, lacking)
        if not missing:
            return None, f"no repository contains {name}/{own}"
        return None, f"{', '.join(missing.get(kind) or next(iter(missing.values())))} of {name} missing"

    @staticmethod
    def mains(repository, folder):
        """Returns the glTF files of a folder."""
        return [path for path in repository.blobs if path.startswith(folder) and path.endswith((".gltf", ".glb"))]

    def whole(self, repository, main, base):
        """Copies a model with all files that it names to the cache. Returns its path, or None with the missing names."""
        local = "models" + main.removeprefix(base)
        file = self.kept(local, [(repository, main)])
        if file is None:
            return None, [posixpath.basename(main)]
        names = files_of(read_gltf(file)[0])
        folder, kept = posixpath.dirname(main), posixpath.dirname(local)
        lacking = []
        for name in names:
            there = posixpath.normpath(f"{folder}/{name}")
            if self.kept(posixpath.normpath(f"{kept}/{name}"), [(repository, there)]) is None:
                lacking.append(posixpath.basename(name))
        return (None, lacking) if lacking else (file, [])
