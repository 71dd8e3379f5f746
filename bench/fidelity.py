"""Scenes of Khronos' glTF-Render-Fidelity page, rendered from its scenarios, and FLIP to the goldens of the other renderers.

    python3 bench fidelity SOURCES [--only NAME …] [--width N] [--spp N] [--denoise] [--still] [--cache DIR] [--output DIR]

SOURCES is a folder of git clones, named NAME or OWNER+NAME; missing ones are listed by the error message or per scene:

    KhronosGroup/glTF-Render-Fidelity             goldens, 512 pixels wide (required)
    KhronosGroup/glTF-Render-Fidelity-Generator   scenarios and environments; its fork BruceCherniak/glTF-Render-Fidelity has
                                                  the older scenarios of the goldens, and comes first
    KhronosGroup/glTF-Sample-Assets               models; older copies of other owners are used as well (fidelity_files.py)

Each scene is path-traced with the page's camera, environment, alpha and tone curve (fidelity_scene.py). Our picture and the
goldens are reduced to the smaller width and put on white. Files are kept in the cache, pictures in OUTPUT. A later run
renders only scenes that changed.

    FLIP       mean over the picture, 0 for equal pictures
    verdict    "yes": our FLIP to Cycles' golden is at most the largest of the other path tracers' FLIP to it

OUTPUT receives table.md, results.json, and sheets of ours, Cycles, one more path tracer, and FLIP per pixel (ours to Cycles).
Requires numpy, pillow, OpenEXR and flip-evaluator from PyPI; --denoise also pyoidn.
"""

import hashlib
import importlib.util
import json
import sys
import time
from pathlib import Path

import presets
import tables
from running import ROOT, Failure, add_program, need_program

# Python modules, and their packages on PyPI.
PACKAGES = {"numpy": "numpy", "PIL": "pillow", "OpenEXR": "OpenEXR", "flip_evaluator": "flip-evaluator"}
CYCLES = "blender-cycles"
# Golden names of path tracers other than Cycles, and of rasterizers, with their titles.
PATH_TRACERS = {"vray": "V-Ray", "stellar": "Stellar", "dspbr-pt": "dspbr", "three-gpu-pathtracer": "three-gpu"}
RASTERIZERS = {
    "model-viewer": "model-viewer",
    "filament": "Filament",
    "babylon": "Babylon",
    "gltf-sample-viewer": "Sample Viewer",
    "rhodonite": "Rhodonite",
}
TITLES = {CYCLES: "Cycles", **PATH_TRACERS, **RASTERIZERS}
# Width of the goldens [pixels].
GOLDEN_WIDTH = 512
# Scenes with metal, roughness, textures and normal maps only.
PLAIN = ["DamagedHelmet", "Avocado", "Duck", "Suzanne", "BoomBoxWithAxes", "CesiumMilkTruck", "EnvironmentTest"]
QUICK = {"only": PLAIN, "width": 512, "spp": 16}
FULL = {"only": [], "width": 768, "spp": 256}


def add_options(parser):
    """Adds the options of this measurement."""
    parser.add_argument("sources", type=Path, help="folder of the git clones")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="scenes, with or without khronos- [default: seven; full: all]")
    parser.add_argument("--all", action="store_true", help="all scenes, also in a quick measurement")
    parser.add_argument("--width", type=int, help="width of our pictures in pixels [default: 512; full: 768]")
    parser.add_argument("--spp", type=int, help="paths per pixel [default: 16; full: 256]")
    parser.add_argument("--denoise", action="store_true", help="apply OIDN, as Cycles' goldens do")
    parser.add_argument("--still", action="store_true", help="render with the film's renderer instead of the path tracer")
    parser.add_argument("--config", type=Path, help="another config.json of the generator")
    parser.add_argument("--threads", type=int, help="threads of the program [default: all]")
    parser.add_argument("--cache", type=Path, help="folder of models, environments and goldens [default: ~/.cache/render2mpeg/fidelity]")
    parser.add_argument("--output", type=Path, default=ROOT / "out" / "bench-fidelity", help="[default: out/bench-fidelity]")
    add_program(parser)


def need_packages(options):
    """Checks that all packages are installed."""
    wanted = {**PACKAGES, **({"pyoidn": "pyoidn"} if options.denoise else {})}
    missing = [package for module, package in wanted.items() if importlib.util.find_spec(module) is None]
    if missing:
        raise Failure(f"{', '.join(missing)} missing; install: python3 -m pip install {' '.join(missing)}")


def short(name):
    """Returns the name of a scenario without the prefix of the page."""
    return name.removeprefix("khronos-")


def chosen(scenarios, options):
    """Returns the selected scenarios."""
    only = [] if options.all else [short(name) for name in options.only]
    unknown = set(only) - {short(scenario["name"]) for scenario in scenarios}
    if unknown:
        raise Failure(f"no scenario {', '.join(sorted(unknown))}")
    return [scenario for scenario in scenarios if not only or short(scenario["name"]) in only]


def scaled(scenario, width):
    """Returns the completed scenario with another width and the same shape."""
    size = scenario["dimensions"]
    height = max(1, round(size["height"] * width / size["width"]))
    return {**scenario, "dimensions": {"width": width, "height": height}}


def ours(options, quality, scenario, model, lighting):
    """Returns our picture of a scenario as RGBA, rendered or kept from an earlier run with the same inputs."""
    import fidelity_scene
    from PIL import Image

    inputs = [options.program_hash, scenario, vars(quality) | {"threads": None}, model.stat().st_size, lighting.stat().st_size]
    digest = hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()[:12]
    kept = options.output / "ours" / f"{short(scenario['name'])}-{digest}.png"
    if not kept.is_file():
        kept.parent.mkdir(parents=True, exist_ok=True)
        folder = options.output / "scenes" / short(scenario["name"])
        pixels = fidelity_scene.render(options.program, scenario, model, lighting, folder, quality)
        Image.fromarray(pixels).save(kept)
    return Image.open(kept).convert("RGBA")


def on_white(picture, size):
    """Returns the picture resized and put on white: an array of values 0…1. The page resizes with Lanczos, too."""
    import numpy as np
    from PIL import Image

    # Resize with premultiplied alpha, so that hidden colors do not leak.
    resized = picture.convert("RGBa").resize(size, Image.LANCZOS).convert("RGBA")
    white = Image.new("RGBA", size, "white")
    return np.asarray(Image.alpha_composite(white, resized).convert("RGB"), np.float32) / 255


def flip(reference, test):
    """Returns FLIP per pixel and its mean."""
    import flip_evaluator

    errors, mean, _ = flip_evaluator.evaluate(reference, test, "LDR", applyMagma=False)
    return errors, float(mean)


def compared(picture, goldens, options):
    """Returns FLIP of ours and of the path tracers, the pictures on white, and FLIP per pixel to Cycles."""
    from PIL import Image

    loaded = {name: Image.open(path).convert("RGBA") for name, path in goldens.items()}
    width = min(options.width, GOLDEN_WIDTH)
    size = (width, max(1, round(picture.height * width / picture.width)))
    for name, golden in list(loaded.items()):
        # A golden of another shape shows another scenario.
        if abs(golden.height / golden.width - picture.height / picture.width) > 0.01:
            del loaded[name]
    views = {name: on_white(golden, size) for name, golden in loaded.items()}
    own = on_white(picture, size)
    to_goldens = {name: flip(view, own)[1] for name, view in views.items()}
    to_cycles, errors = {}, None
    if CYCLES in views:
        errors = flip(views[CYCLES], own)[0]
        to_cycles = {name: flip(views[CYCLES], views[name])[1] for name in PATH_TRACERS if name in views}
    return to_goldens, to_cycles, {"ours": own, **views}, errors


def verdict(result):
    """Returns whether ours is as close to Cycles as another path tracer is: "yes", "no", or a dash without others."""
    own, others = result["to_goldens"].get(CYCLES), result["to_cycles"].values()
    if own is None or not others:
        return "–"
    return "yes" if own <= max(others) else "no"


def report(results):
    """Returns both tables and the summary in Markdown."""
    form = ".3f"
    rows = [
        [short(name), *(tables.figure(result["to_goldens"].get(key), form) for key in TITLES)] for name, result in results.items()
    ]
    first = tables.table(["FLIP of ours to", *TITLES.values()], rows)
    rows = []
    for name, result in results.items():
        others = (tables.figure(result["to_cycles"].get(key), form) for key in PATH_TRACERS)
        own = tables.figure(result["to_goldens"].get(CYCLES), form)
        rows.append([short(name), own, *others, verdict(result), ", ".join(result["extensions"])])
    second = tables.table(["FLIP to Cycles of", "ours", *PATH_TRACERS.values(), "verdict", "material extensions"], rows)
    judged = [verdict(result) for result in results.values() if verdict(result) != "–"]
    plain = [verdict(result) for result in results.values() if verdict(result) != "–" and not result["extensions"]]
    summary = f"{judged.count('yes')} of {len(judged)} scenes are as close to Cycles as another path tracer; "
    summary += f"without material extensions, {plain.count('yes')} of {len(plain)}."
    return f"{first}\n\n{second}\n\n{summary}\n"


def material_extensions(model):
    """Returns the material extensions that a model's materials use, without their common prefix."""
    import fidelity_scene

    materials = fidelity_scene.read_gltf(model)[0].get("materials", [])
    names = {name for material in materials for name in material.get("extensions", {})}
    return sorted(name.removeprefix("KHR_materials_") for name in names if "_materials_" in name)


class Sheet:
    """Pages of picture rows, two scenes across: ours, Cycles, another path tracer, and FLIP per pixel."""

    ACROSS, DOWN, SIDE, HEAD = 2, 6, 180, 16

    def __init__(self, output):
        self.output, self.count, self.page = output, 0, None

    def add(self, name, views, errors, result):
        """Adds a scene."""
        from PIL import Image, ImageDraw

        place = self.count % (self.ACROSS * self.DOWN)
        if place == 0:
            self.save()
            self.page = Image.new("RGB", (self.ACROSS * (4 * self.SIDE + 8), self.DOWN * (self.SIDE + self.HEAD)), "white")
        third = next((key for key in [*PATH_TRACERS, *RASTERIZERS] if key in views), None)
        x, y = place % self.ACROSS * (4 * self.SIDE + 8), place // self.ACROSS * (self.SIDE + self.HEAD)
        cells = [views["ours"], views.get(CYCLES), views.get(third), errors]
        for k, cell in enumerate(cells):
            if cell is not None:
                self.page.paste(self.thumbnail(cell), (x + k * self.SIDE, y + self.HEAD))
        own = tables.figure(result["to_goldens"].get(CYCLES), ".3f")
        titles = [f"{short(name)}: ours {own.replace('–', '-')}", "Cycles", TITLES.get(third, "none")]
        title = ", ".join(titles) + "; " + verdict(result).replace("–", "no verdict")
        ImageDraw.Draw(self.page).text((x + 2, y + 2), title, "black")
        self.count += 1

    def thumbnail(self, cell):
        """Returns a picture, or FLIP per pixel from black to white, as large as fits."""
        import numpy as np
        from PIL import Image

        cell = np.repeat(cell, 3, axis=-1) if cell.shape[-1] == 1 else cell
        image = Image.fromarray((np.clip(cell, 0, 1) * 255).astype(np.uint8))
        image.thumbnail((self.SIDE, self.SIDE), Image.LANCZOS)
        return image

    def save(self):
        """Writes the current page."""
        if self.page is not None:
            number = (self.count - 1) // (self.ACROSS * self.DOWN) + 1
            self.page.save(self.output / f"sheet-{number:02}.jpg", quality=90)


def main(options):
    """Renders, compares and prints."""
    presets.fill_in(options, QUICK, FULL)
    need_packages(options)
    import fidelity_files
    import fidelity_scene

    options.program = need_program(options)
    options.program_hash = hashlib.sha256(options.program.read_bytes()).hexdigest()
    options.output.mkdir(parents=True, exist_ok=True)
    files = fidelity_files.Files(options.sources, options.cache or fidelity_files.cache_folder())
    scenarios, goldens = files.scenarios(options.config), files.goldens()
    quality = fidelity_scene.Quality(options.spp, options.still, options.denoise, options.threads)
    results, left_out, remarks, sheet = {}, [], [], Sheet(options.output)
    if options.all or not options.only:
        unknown = sorted(set(goldens) - {scenario["name"] for scenario in scenarios})
        left_out += [f"{short(name)}: config.json has no scenario of this name" for name in unknown]
    for scenario in chosen(scenarios, options):
        name, whole = scenario["name"], fidelity_scene.complete(scenario)
        model, remark = files.model(whole["model"])
        lighting = files.environment(whole["lighting"])
        if name not in goldens or model is None or lighting is None:
            reason = remark if model is None else "no environment " + Path(whole["lighting"]).name
            left_out.append(f"{short(name)}: {'no goldens' if name not in goldens else reason}")
            continue
        if remark:
            remarks.append(f"{short(name)}: the model's variant {remark} replaces that of the scenario")
        begin = time.monotonic()
        try:
            picture = ours(options, quality, scaled(whole, options.width), model, lighting)
        except Failure as failure:
            left_out.append(f"{short(name)}: {failure}")
            continue
        paths = {key: files.golden(path) for key, path in goldens[name].items() if key in TITLES}
        to_goldens, to_cycles, views, errors = compared(picture, paths, options)
        result = {"to_goldens": to_goldens, "to_cycles": to_cycles, "extensions": material_extensions(model)}
        results[name] = result
        sheet.add(name, views, errors, result)
        spent = time.monotonic() - begin
        print(f"{short(name)}: {tables.figure(to_goldens.get(CYCLES), '.3f')}, {spent:.0f} s", file=sys.stderr, flush=True)
    sheet.save()
    text = report(results)
    (options.output / "table.md").write_text(text, encoding="utf-8")
    (options.output / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    print(text)
    for line in remarks:
        print(line)
    for line in left_out:
        print(f"left out: {line}")
    print(f"pictures: {options.output}/sheet-*.jpg")
    if not results:
        raise Failure("no scene was rendered")
