"""Pictures of glTF models with global illumination, by the program render2mpeg."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile

__all__ = ["Error", "program", "run", "still"]


class Error(RuntimeError):
    """Failure of the program, with its message."""


def program():
    """Returns the path of the program.

    Raises:
        Error: The program is not installed.
    """
    name = "render2mpeg.exe" if sys.platform == "win32" else "render2mpeg"
    # Prefer the program of this package over others in PATH.
    schemes = [None, "posix_user" if os.name == "posix" else "nt_user"]
    for scheme in schemes:
        folder = sysconfig.get_path("scripts", scheme) if scheme else sysconfig.get_path("scripts")
        path = os.path.join(folder, name)
        if os.path.isfile(path):
            return path
    found = shutil.which(name)
    if found is None:
        raise Error("the program render2mpeg is not installed; install it with pip install render2mpeg")
    return found


def run(*arguments):
    """Runs the program with `arguments`, and returns its messages.

    Raises:
        Error: The program failed; the message is its own.
    """
    words = [program(), *map(str, arguments)]
    finished = subprocess.run(words, capture_output=True, text=True, check=False)
    if finished.returncode != 0:
        raise Error(finished.stderr.strip() or f"render2mpeg ended with exit code {finished.returncode}")
    return finished.stderr


def still(path, **options):
    """Renders a picture of the glTF scene at `path`.

    Args:
        path: File of the scene, .glb or .gltf.
        options: Options of `render2mpeg still`, with underscores for hyphens. `True` gives an option without a value.
            `size` may be (width, height), and `orbit` (degrees, degrees) or (degrees, degrees, meters).

    Returns:
        Array of shape (height, width, 3), or (height, width, 4) with background="transparent"; sRGB codes, uint8.

    Raises:
        Error: The program failed; the message is its own.
    """
    import numpy
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        picture = os.path.join(folder, "picture.png")
        run("still", os.fspath(path), "--output", picture, "--quiet", *_words(options))
        with Image.open(picture) as image:
            return numpy.asarray(image)


def _words(options):
    """Returns the words of options on a command line."""
    words = []
    for name, value in options.items():
        if value is None or value is False:
            continue
        word = "--" + name.replace("_", "-")
        is_list = isinstance(value, (list, tuple))
        if value is True:
            words.append(word)
        elif is_list and all(isinstance(item, str) for item in value):
            # Repeat an option with several texts, such as set=["exposure=2", "gamma=2.4"].
            words += [part for item in value for part in (word, item)]
        else:
            separator = "x" if name == "size" else ","
            words += [word, separator.join(map(str, value)) if is_list else str(value)]
    return words
