"""Bounded rates on difficult clips, against our constant quantiser and ffmpeg's default.

    python3 bench rates [--only CLIP] [--rate KBPS] [--encoder PROGRAM]

ffmpeg generates the clips: 75 frames of 352x288 each, at 25 frames per second. Each is coded with each effort in two modes.

- Constant: `--bitrate KBPS`.
- Bound: `--qscale 4 --maxrate KBPS`.

In both, the decoder has a buffer of half a second. Rates are of the elementary stream, with stuffing. PSNR is of luma, over
all frames together.
"Lead" is our gain [dB] over our finest constant quantiser with a stream that is no larger and that the same buffer
supports. That buffer is as full as ours at the first picture and, for a constant rate, as full again at the end.
"Any" is the gain over the finest quantiser with no larger stream, whether or not the buffer supports it. In a clip that is
quiet first and busy later, no bounded rate can reach it.
ffmpeg's default has the same constant rate: `-b:v`, `-maxrate`, `-minrate` and `-bufsize`.

The measurement requires ffmpeg, and the example program: cargo build --release --package mpeg2enc --example mpeg2enc.
"""

import concurrent.futures
import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import tables
from running import RELEASE, Failure, need_built, need_installed, run

FPS, FRAMES, SIZE = 25, 75, "352x288"
EFFORTS = ["fast", "balanced", "best"]
QSCALES = [*range(1, 9), *range(10, 25, 2), *range(28, 63, 4), 64, *range(72, 113, 8)]
BOUND_QSCALE = 4
# Initial fullness of the buffer for a constant rate and for a bound, as a fraction.
START = {"constant": 11 / 16, "bound": 1}

# A slow, slightly blurred zoom, and its first frame alone.
ZOOM = f"mandelbrot=size={SIZE}:rate={FPS}:start_scale=0.4:end_scale=0.2:end_pts=400,gblur=1.2"
FAST_ZOOM = f"mandelbrot=size={SIZE}:rate={FPS}:start_scale=0.5:end_scale=0.02:end_pts=200"
STILL = f"{ZOOM},select='eq(n,0)',loop=loop={FRAMES}:size=1,setpts=N/{FPS}/TB"
NOISE = "noise=alls=2:allf=t"
TITLE = [("0:0:352:288", "black"), ("80:120:190:12", "white"), ("120:150:110:8", "gray")]
CLIPS = {
    "black, fade": f"{ZOOM},tpad=start=30:color=black,fade=in:30:25,noise=c0s=1:allf=t",
    "fades": f"{ZOOM},fade=in:0:25,fade=out:50:25,{NOISE}",
    "stills": f"{ZOOM},fps=1,fps={FPS}",
    "drawings": f"testsrc2=size={SIZE}:rate={FPS},fps=3,fps={FPS}",
    "static noise": f"{STILL},{NOISE}",
    "flashes": f"{STILL},negate=enable='eq(mod(n,15),14)',{NOISE}",
    "cuts": f"{FAST_ZOOM},hue=h='90*floor(t)',rotate='floor(t)*1.3'",
    "title, action": ",".join([ZOOM, *(f"drawbox={box}:{color}:fill:enable='lt(n,35)'" for box, color in TITLE), NOISE]),
    "screen": f"testsrc=size={SIZE}:rate={FPS}",
    "film": f"{ZOOM},noise=alls=3:allf=t",
}


@dataclass(frozen=True)
class Stream:
    """Rate [kbit/s], PSNR of luma [dB], and bits of each picture in coding order."""

    rate: float
    psnr: float
    pictures: tuple = ()

    def is_held(self, kbps, mode):
        """Returns whether a buffer of half a second at this rate never underflows, and ends as full as a constant rate requires."""
        size = 500 * kbps // 16384 * 16384
        fullness = START[mode] * size
        for bits in self.pictures:
            if bits > fullness:
                return False
            fullness = min(size, fullness - bits + 1000 * kbps / FPS)
        return mode == "bound" or fullness >= START[mode] * size


def add_options(parser):
    """Adds the options of this measurement."""
    parser.add_argument("--encoder", type=Path, help="our encoder [default: target/release/examples/mpeg2enc]")
    parser.add_argument("--only", default="", help="clips whose name has this in it")
    parser.add_argument("--rate", type=int, default=800, metavar="KBPS", help="kbit/s of both modes [default: 800]")
    parser.add_argument("--jobs", type=int, default=2, help="streams coded at once [default: 2]")


def made(source, path):
    """Makes a clip as YUV4MPEG2."""
    words = ["ffmpeg", "-nostdin", "-v", "error", "-f", "lavfi", "-i", source, "-frames:v", FRAMES, "-pix_fmt", "yuv420p", path]
    run(words)
    return path


class Encoded:
    """Streams of a clip with one effort; streams of constant quantisers are made once."""

    def __init__(self, encoder, clip, effort):
        self.words = [encoder, clip, "--effort", effort, "--verbose"]
        self.constant = {}

    def coded(self, *words):
        """Encodes a stream with these options."""
        with tempfile.TemporaryDirectory() as folder:
            lines = run([*self.words, *words, "-o", Path(folder) / "out.m2v"]).output.splitlines()
        rate, psnr = re.search(r"([\d.]+) kbit/s, (inf|[\d.]+) dB", lines[-1]).groups()
        return Stream(float(rate), float(psnr), tuple(int(line.split()[2]) for line in lines[:-1]))

    def finest(self, fits):
        """Returns the finest constant quantiser that fits, or nothing: coarser ones fit too."""
        low, high = 0, len(QSCALES)
        while low < high:
            middle = (low + high) // 2
            qscale = QSCALES[middle]
            if qscale not in self.constant:
                self.constant[qscale] = self.coded("--qscale", qscale)
            low, high = (low, middle) if fits(self.constant[qscale]) else (middle + 1, high)
        return self.constant[QSCALES[low]] if low < len(QSCALES) else None

    def cells(self, mode, kbps):
        """Returns the cells of the table for a mode."""
        words = ["--bitrate", kbps] if mode == "constant" else ["--qscale", BOUND_QSCALE, "--maxrate", kbps]
        stream = self.coded(*words)
        held = self.finest(lambda other: other.rate <= stream.rate and other.is_held(kbps, mode))
        smaller = self.finest(lambda other: other.rate <= stream.rate)
        leads = [tables.figure(other and stream.psnr - other.psnr, "+.2f") for other in (held, smaller)]
        return [f"{stream.rate:.0f}", f"{stream.psnr:.2f}", *leads]


def of_ffmpeg(clip, kbps):
    """Returns the cells of ffmpeg's default."""
    bounds = ["-b:v", f"{kbps}k", "-maxrate", f"{kbps}k", "-minrate", f"{kbps}k", "-bufsize", f"{kbps // 2}k"]
    quiet = ["ffmpeg", "-nostdin", "-hide_banner", "-threads", "1"]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.m2v"
        run([*quiet, "-i", clip, "-c:v", "mpeg2video", *bounds, "-f", "mpeg2video", out])
        rate = out.stat().st_size * 8 * FPS / FRAMES / 1000
        pairs = "[0]settb=1/25,setpts=N[a];[1]settb=1/25,setpts=N[b];[a][b]psnr"
        words = [*quiet, "-i", out, "-i", clip, "-lavfi", pairs, "-f", "null", "-"]
        told = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False).stderr
    found = re.search(r"PSNR y:(inf|[\d.]+)", told)
    if not found:
        raise Failure(f"ffmpeg tells no PSNR of its stream of {clip.name}")
    return [f"{rate:.0f}", f"{float(found[1]):.2f}"]


def main(options):
    """Prints the table."""
    need_installed("ffmpeg")
    build = "cargo build --release --package mpeg2enc --example mpeg2enc"
    encoder = need_built(options.encoder or RELEASE / "examples" / "mpeg2enc", build)
    names = [name for name in CLIPS if options.only in name]
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        clips = {name: made(CLIPS[name], Path(folder) / f"{name.replace(', ', '-')}.y4m") for name in names}
        encoded = {(name, effort): Encoded(encoder, clips[name], effort) for name in names for effort in EFFORTS}
        titles = ["clip", "effort"]
        titles += [title for mode in START for title in (f"{mode}, kbit/s", "PSNR", "lead", "any")]
        print(tables.header([*titles, "ffmpeg, kbit/s", "PSNR"]), flush=True)
        theirs = dict(zip(names, pool.map(lambda name: of_ffmpeg(clips[name], options.rate), names)))
        both = lambda one: [cell for mode in START for cell in one.cells(mode, options.rate)]  # noqa: E731
        for (name, effort), cells in zip(encoded, pool.map(both, encoded.values())):
            print(tables.row([name, effort, *cells, *theirs[name]]), flush=True)
