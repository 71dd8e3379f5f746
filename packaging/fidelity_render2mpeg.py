#!/usr/bin/env python3
"""Command-line renderer for Khronos' glTF-Render-Fidelity-Generator: renders one scenario to one golden.

Add this entry to "renderers" in the generator's test/config.json, with the paths of this repository and of the program:

    {
      "name": "render2mpeg",
      "description": "render2mpeg path tracer",
      "command": {
        "executable": "python3",
        "args": ["RENDER2MPEG/packaging/fidelity_render2mpeg.py", "--program", "RENDER2MPEG/target/release/render2mpeg"]
      }
    }

The generator appends a JSON text with "scenario" and "outputFile". It starts programs in its root folder. Paths of models and
environments are relative to test/renderers/NAME. As for the other command-line renderers, goldens have twice the scenario's
width and height.

    npm run render-goldens -- --config test/config.json --renderer=render2mpeg --scenario=DamagedHelmet

Requires numpy, pillow and OpenEXR from PyPI; --denoise also pyoidn.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bench"))
import fidelity_scene  # noqa: E402
from PIL import Image  # noqa: E402
from running import Failure, need_files  # noqa: E402


def arguments():
    """Returns the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="render2mpeg", help="path of the program, or its name in PATH")
    parser.add_argument("--spp", type=int, default=256, help="paths per pixel [default: 256]")
    parser.add_argument("--scale", type=float, default=2, help="pixels per pixel of the scenario [default: 2]")
    parser.add_argument("--denoise", action="store_true", help="apply OIDN, as the script for Cycles does")
    parser.add_argument("--root", type=Path, default=Path(), help="root of the generator [default: the current folder]")
    parser.add_argument("job", type=json.loads, help='JSON text: {"scenario": {…}, "outputFile": "…"}')
    return parser.parse_args()


def main():
    """Renders the scenario of the command line."""
    options = arguments()
    scenario = fidelity_scene.complete(options.job["scenario"])
    base = options.root / "test" / "renderers" / "render2mpeg"
    # The folder of a renderer need not exist, so ".." is resolved without it.
    model, lighting = (Path(base / scenario[key]).resolve() for key in ("model", "lighting"))
    need_files([model, lighting])
    size = scenario["dimensions"]
    scenario["dimensions"] = {key: round(options.scale * size[key]) for key in ("width", "height")}
    quality = fidelity_scene.Quality(spp=options.spp, denoise=options.denoise)
    with tempfile.TemporaryDirectory() as folder:
        pixels = fidelity_scene.render(options.program, scenario, model, lighting, folder, quality)
    # Goldens with a visible sky have no alpha.
    image = Image.fromarray(pixels)
    output = options.root / options.job["outputFile"]
    output.parent.mkdir(parents=True, exist_ok=True)
    (image.convert("RGB") if scenario["renderSkybox"] else image).save(output)


if __name__ == "__main__":
    try:
        main()
    except Failure as failure:
        sys.exit(f"fidelity_render2mpeg: {failure}")
