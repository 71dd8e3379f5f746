"""Our saliency against an independent program by the formulas of Itti, Koch & Niebur 1998, in numpy and f64.

    python3 bench/saliency.py FRAMES … [--frame N] [--motion] [--pictures FOLDER] [--program PROGRAM]

FRAMES are films (.y4m, 4:2:0) or pictures (.png, .ppm). Each has one line of output: the size, the correlation of the two
maps over all pixels, the largest difference, and the largest saliency. --motion adds a disk that moves by 3 pixels.
--pictures writes the frame and both maps side by side.

The program is an example of the crate perceptual; if it is missing, the build command is printed.
Requires numpy; pillow for pictures. Exit code 1: a correlation is below 0.98. Exit code 77: numpy is missing.

The formulas are transcribed in full and share no code with the Rust crate: two-dimensional kernels, maxima by
brute force, all maps. perceptual/src/saliency/mod.rs has the same formulas and the sources of their numbers.
"""

import argparse
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
    from numpy.lib.stride_tricks import sliding_window_view
except ImportError:
    sys.exit(77)

from running import RELEASE, Failure, need_built, need_files, run

BUILD = "cargo build --release -p render2mpeg-perceptual --example saliency"
LEAST_CORRELATION = 0.98
CENTERS, DELTAS = (2, 3, 4), (3, 4)
DEEPEST = 8
MAP_LEVEL = 4
# Smallest maxima by which maps are divided: intensity, colors, orientations, motion [pixels per frame]; then channels.
FLOORS = {"I": 0.01, "RG": 0.06, "BY": 0.06, "O": 0.005, "U": 0.1}
CHANNEL_FLOOR = 1.0
PERIOD, SPREAD, REACH = 7.0, 7.0 / 3.0, 7


def correlated(plane, kernel):
    """Correlates a plane with a two-dimensional kernel of odd sides, borders reflected."""
    rows, columns = kernel.shape
    padded = np.pad(plane, ((rows // 2,) * 2, (columns // 2,) * 2), mode="symmetric")
    return np.einsum("yxij,ij->yx", sliding_window_view(padded, kernel.shape), kernel)


def next_level(plane):
    """Halves width and height: each sample is the weighted mean of the 6x6 samples around its 2x2."""
    binomial = np.array([1, 5, 10, 10, 5, 1]) / 32
    # Add a row and a column to odd sizes.
    height, width = plane.shape
    padded = np.pad(plane, ((2, 2 + height % 2), (2, 2 + width % 2)), mode="symmetric")
    windows = sliding_window_view(padded, (6, 6))[::2, ::2]
    return np.einsum("yxij,i,j->yx", windows, binomial, binomial)


def pyramid(plane):
    """Returns levels 0 to 8, or up to one sample."""
    levels = [plane]
    while len(levels) <= DEEPEST and max(levels[-1].shape) > 1:
        levels.append(next_level(levels[-1]))
    return levels


def interpolated(plane, size, levels):
    """Enlarges a plane by `levels` levels to `size`, linearly between the centers of samples."""

    def axis(count, wanted):
        place = np.clip((np.arange(wanted) + 0.5) / 2**levels - 0.5, 0, count - 1)
        low = np.minimum(place.astype(int), max(count - 2, 0))
        return low, np.minimum(low + 1, count - 1), place - low

    top, bottom, down = axis(plane.shape[0], size[0])
    left, right, along = axis(plane.shape[1], size[1])
    upper = plane[top][:, left] * (1 - along) + plane[top][:, right] * along
    lower = plane[bottom][:, left] * (1 - along) + plane[bottom][:, right] * along
    return upper * (1 - down)[:, None] + lower * down[:, None]


def promoted(plane, floor):
    """Returns N of a map, which emphasizes few large maxima over many equal ones."""
    highest = plane.max()
    if highest <= 0:
        return np.zeros_like(plane)
    # The window extends by a sixteenth of the map on each side, at least by one sample.
    reach = [max(1, side // 16) for side in plane.shape]
    padded = np.pad(plane, [(r, r) for r in reach], constant_values=-np.inf)
    around = sliding_window_view(padded, [2 * r + 1 for r in reach])
    maxima = np.argwhere((plane == around.max(axis=(2, 3))) & (plane > highest / 100))
    # Of equal maxima within a window, only the first in raster order counts.
    before = np.arange(around[0, 0].size).reshape(around.shape[2:]) < around[0, 0].size // 2
    others = [plane[y, x] for y, x in maxima if not (around[y, x][before] == plane[y, x]).any()]
    if highest in others:
        others.remove(highest)
    mean = np.mean(others) if others else 0
    return plane / max(highest, floor) * (1 - mean / highest) ** 2


def gabor_magnitude(plane, degrees):
    """Returns the magnitude of the even and odd Gabor responses, 1 for a wave of amplitude 1; waves run along `degrees`."""
    y, x = np.mgrid[-REACH : REACH + 1, -REACH : REACH + 1].astype(float)
    bell = np.exp(-(x**2 + y**2) / (2 * SPREAD**2))
    phase = 2 * np.pi / PERIOD * (x * np.cos(np.radians(degrees)) + y * np.sin(np.radians(degrees)))
    # The even part has no mean.
    even = bell * (np.cos(phase) - (bell * np.cos(phase)).sum() / bell.sum())
    odd = bell * np.sin(phase)
    return 2 / bell.sum() * np.hypot(correlated(plane, even), correlated(plane, odd))


def features(rgb):
    """Returns I, R - G and B - Y of a picture of display values."""
    rgb = np.clip(np.where(np.isfinite(rgb).all(axis=2, keepdims=True), rgb, 0), 0, 1)
    intensity = rgb.mean(axis=2)
    bright = intensity > intensity.max() / 10
    r, g, b = (np.where(bright, rgb[..., i] / np.where(bright, intensity, 1), 0) for i in range(3))
    red, green, blue = (np.maximum(x, 0) for x in (r - (g + b) / 2, g - (r + b) / 2, b - (r + g) / 2))
    yellow = np.maximum((r + g) / 2 - abs(r - g) / 2 - b, 0)
    return intensity, red - green, blue - yellow


def feature_map(levels, floor):
    """Returns the sum of N(|c - s|) over all pairs of levels, at level 4."""
    total = 0
    for c in CENTERS:
        for s in (c + delta for delta in DELTAS):
            if s < len(levels):
                surround = interpolated(levels[s], levels[c].shape, s - c)
                conspicuous = promoted(abs(levels[c] - surround), floor)
                for _ in range(c, MAP_LEVEL):
                    conspicuous = next_level(conspicuous)
                total = total + conspicuous
    return total


def oriented(intensity, degrees):
    """Returns a pyramid of Gabor magnitudes; levels that no pair reads are unchanged."""
    return [gabor_magnitude(level, degrees) if k >= CENTERS[0] else level for k, level in enumerate(intensity)]


def saliency(rgb, motion=None):
    """Returns the saliency, 0 to 1, of a picture of display values and of motion [pixels per frame]."""
    intensity, red_green, blue_yellow = (pyramid(plane) for plane in features(rgb))
    if len(intensity) <= CENTERS[0] + DELTAS[0]:
        return np.zeros(rgb.shape[:2])
    directions = [feature_map(oriented(intensity, degrees), FLOORS["O"]) for degrees in (0, 45, 90, 135)]
    channels = [
        feature_map(intensity, FLOORS["I"]),
        feature_map(red_green, FLOORS["RG"]) + feature_map(blue_yellow, FLOORS["BY"]),
        sum(promoted(direction, CHANNEL_FLOOR) for direction in directions),
    ]
    if motion is not None:
        channels.append(sum(feature_map(pyramid(motion[..., axis]), FLOORS["U"]) for axis in (0, 1)))
    mean = sum(promoted(channel, CHANNEL_FLOOR) for channel in channels) / len(channels)
    return interpolated(mean, rgb.shape[:2], MAP_LEVEL)


def read_film(path, frame):
    """Returns the display values of a frame of a 4:2:0 film; each chroma sample covers its 2x2 pixels."""
    header, _, rest = path.read_bytes().partition(b"\n")
    words = {word[:1]: word[1:] for word in header.split()[1:]}
    width, height = int(words[b"W"]), int(words[b"H"])
    if not words.get(b"C", b"420").startswith(b"420") or width % 2 or height % 2:
        raise Failure(f"{path} is not 4:2:0, or its size is odd")
    size = width * height * 3 // 2
    begin = frame * (len(b"FRAME\n") + size) + len(b"FRAME\n")
    codes = np.frombuffer(rest[begin : begin + size], np.uint8)
    if len(codes) != size:
        raise Failure(f"{path} has no frame {frame}")
    luma, blue, red = np.split(codes.astype(float), [width * height, width * height * 5 // 4])
    luma = (luma.reshape(height, width) - 16) / 219
    blue, red = (((c.reshape(height // 2, width // 2) - 128) / 224).repeat(2, 0).repeat(2, 1) for c in (blue, red))
    r, b = luma + 1.5748 * red, luma + 1.8556 * blue
    return np.clip(np.dstack([r, (luma - 0.2126 * r - 0.0722 * b) / 0.7152, b]), 0, 1)


def read_picture(path, frame):
    """Returns the display values of a frame or a picture, in steps of 1/255."""
    if path.suffix == ".y4m":
        rgb = read_film(path, frame)
    else:
        from PIL import Image

        rgb = np.asarray(Image.open(path).convert("RGB")) / 255
    return np.round(rgb * 255).astype(np.uint8)


def moving_disk(height, width):
    """Returns the motion [pixels per frame] of a disk in the upper left of a static picture."""
    y, x = np.mgrid[0:height, 0:width]
    inside = np.hypot(x - width / 4, y - height / 4) < min(width, height) / 12
    return np.dstack([3.0 * inside, -1.0 * inside])


def ours(program, codes, motion):
    """Returns the map of the Rust program."""
    height, width, _ = codes.shape
    with tempfile.TemporaryDirectory() as folder:
        names = [str(Path(folder) / name) for name in ("picture.ppm", "map.pfm", "motion.pfm")]
        Path(names[0]).write_bytes(b"P6\n%d %d\n255\n" % (width, height) + codes.tobytes())
        if motion is not None:
            samples = np.dstack([motion, np.zeros((height, width))])[::-1].astype("<f4")
            Path(names[2]).write_bytes(b"PF\n%d %d\n-1\n" % (width, height) + samples.tobytes())
        run([program, *names[: 2 if motion is None else 3]])
        samples = Path(names[1]).read_bytes().split(b"\n", 3)[3]
        return np.frombuffer(samples, "<f4").reshape(height, width)[::-1].astype(float)


def write_picture(path, codes, maps):
    """Writes the frame and the maps side by side; the largest value of all maps is white."""
    from PIL import Image

    white = max(map.max() for map in maps) or 1
    gray = [np.repeat(np.round(255 * map / white).astype(np.uint8)[..., None], 3, axis=2) for map in maps]
    Image.fromarray(np.hstack([codes, *gray])).save(path)


def main():
    """Compares frame by frame."""
    style = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=style)
    parser.add_argument("frames", type=Path, nargs="+", help="films (.y4m) or pictures")
    parser.add_argument("--frame", type=int, default=0, help="frame of films [default: 0]")
    parser.add_argument("--motion", action="store_true", help="with a disk that moves")
    parser.add_argument("--pictures", type=Path, help="folder for frames and maps side by side")
    parser.add_argument("--program", type=Path, default=RELEASE / "examples" / "saliency", help="our program")
    options = parser.parse_args()
    need_files(options.frames)
    program = need_built(options.program, BUILD)
    lowest = 1.0
    for path in options.frames:
        codes = read_picture(path, options.frame)
        motion = moving_disk(*codes.shape[:2]) if options.motion else None
        theirs, found = saliency(codes / 255, motion), ours(program, codes, motion)
        correlation = np.corrcoef(theirs.ravel(), found.ravel())[0, 1]
        lowest = min(lowest, correlation)
        size = f"{codes.shape[1]}x{codes.shape[0]}"
        difference = abs(theirs - found).max()
        print(f"{path.name:24} {size:9} correlation {correlation:.6f}  difference {difference:.1e}  peak {found.max():.3f}")
        if options.pictures:
            options.pictures.mkdir(parents=True, exist_ok=True)
            write_picture(options.pictures / f"{path.stem}.png", codes, [found, theirs])
    return 0 if lowest >= LEAST_CORRELATION else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failure as failure:
        sys.exit(f"saliency: {failure}")
