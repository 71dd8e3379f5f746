#!/usr/bin/env python3
"""Holds our encoder against the MPEG-2 encoders that are installed: bits at equal quality, and speed.

    cargo run --release -p tests --example clips -- out/clips     # three clips of the shipped scenes, with exact motion
    python3 tests/compare_encoders.py out/clips/*.y4m
    python3 tests/compare_encoders.py --metric ssim --only ours out/clips/*.y4m
    python3 tests/compare_encoders.py --rate out/clips/*.y4m      # constant bit rates instead of constant quantisers
    python3 tests/compare_encoders.py --tools out/clips/*.y4m     # ours at its best, without one tool after the other
    python3 tests/compare_encoders.py --speed out/clips/cornell.y4m
    python3 tests/compare_encoders.py --all out                   # every table above, from nothing: clips are rendered into out

`--all` renders three shipped scenes, 30 frames of each and 60, into the folder's `shipped30` and `shipped60`, and with
`--generator PROGRAM` six other clips into `rendered30` and `rendered60` by `python3 PROGRAM FOLDER CLIP --frames N`; clips that are there
already are taken as they are. Then come bits at equal quality by PSNR and by SSIM, constant rates, the worth of each tool, groups of 60
on the clips of 60 frames, and speed. All of that takes an hour or two; `--only` leaves encoders out.

A clip is YUV4MPEG2, 4:2:0; NAME.mvp and NAME.mvn beside NAME.y4m, where they are there, hold exact motion to the frame before and after
(i16 pairs, little endian, in 64ths of a pixel). `--speed` repeats the clip to 300 frames or more and compares CPU seconds of whole
programs, one thread, medians of `--pairs` interleaved runs, at middle quality (quantiser_scale 16).

Printed is the mean difference of rate at equal quality (BD-rate, monotone cubic over the logarithm of the rate) against ffmpeg with two B
pictures (`-g 15 -bf 2`), or against its default for constant rates; negative is fewer bits. Streams are decoded by ffmpeg; PSNR is of the
squared error of luma over all frames, SSIM of luma in windows of 8x8. The row "y262, published" is of rwillenbacher/y262 f60850e
(`-quality 50 -noaq`), five points over 60 frames of clips of these names, measured on another machine; it is not run here.

Needs numpy, ffmpeg and cargo; mjpegtools' mpeg2enc is used where it is installed.
"""

import argparse
import concurrent.futures
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FFMPEG = "ffmpeg -v error -y -threads 1 -i {clip} -c:v mpeg2video -threads 1 -qmin 1 {options} -f mpeg2video {out}"
SLOWEST = (
    "-g 15 -bf 2 -b_strategy 2 -mbd rd -trellis 2 -cmp 2 -subcmp 2 -mbcmp 2 -precmp 2 -dia_size 4 -pre_dia_size 4 -mepre 2 "
    "-last_pred 3 -bidir_refine 4 -mpv_flags +skip_rd+mv0"
)
MJPEG = "mpeg2enc -v 0 -f 3 --no-constraints -I 0 -a 1 -b 60000 -V 2000 {options} -o {out} < {clip}"
# Options of ours, and whether the motion is given.
OURS = {
    "ours, fast, no B": ("--effort fast --bframes 0", True),
    "ours, fast": ("--effort fast", True),
    "ours, fast, searched": ("--effort fast", False),
    "ours, balanced": ("--effort balanced", True),
    "ours, balanced, searched": ("--effort balanced", False),
    "ours, best": ("--effort best", True),
    "ours, best, searched": ("--effort best", False),
    "ours, best, adaptive": ("--effort best --adaptive", True),
    "ours, best, N=60": ("--effort best --gop 60", True),
}
# Only where a rate is asked for: without a bound on how it is spread.
TWO_PASSES = {
    "ours, balanced, two passes": ("--effort balanced --two-pass", True),
    "ours, best, two passes": ("--effort best --two-pass", True),
}
# Ours at its best with one tool less, or another in its place; the anchor comes first.
TOOLS = {
    "best": ("", True),
    "motion searched": ("", False),
    "no B pictures": ("--bframes 0", True),
    "one B picture in a row": ("--bframes 1", True),
    "one quantiser a picture: no tree, no quantiser choice": ("--uniform", True),
    "no I pictures at new scenes": ("--no-scene-cuts", True),
    "Table B.14 for intra blocks": ("--no-intra-vlc", True),
    "alternate scan": ("--alternate-scan", True),
    "intra DC of 10 bits": ("--dc 10", True),
    "groups of 60": ("--gop 60", True),
    "balanced: no quantiser choice, quick decisions": ("--effort balanced", True),
    "fast: no macroblock-tree, no trellis either": ("--effort fast", True),
}
PUBLISHED = {
    "y262, published": {"fly": -17.1, "static": -31.5, "orbit": -18.1, "pan": -17.1, "cut": -19.2, "plain": -17.8},
}
QUANTISERS, RATES = [2, 4, 8, 16, 31], [500, 1000, 2000, 4000, 8000]


class Clip:
    def __init__(self, path):
        self.path, self.base = path, os.path.splitext(path)[0]
        self.name = os.path.basename(self.base)
        with open(path, "rb") as file:
            header = file.readline()
        tags = {word[:1]: word[1:] for word in header.decode().split()[1:]}
        self.width, self.height = int(tags["W"]), int(tags["H"])
        numerator, denominator = tags["F"].split(":")
        self.fps = int(numerator) / int(denominator)
        self.luma = self.width * self.height
        self.frame = self.luma + 2 * ((self.width + 1) // 2) * ((self.height + 1) // 2)
        self.header = len(header)
        self.frames = (os.path.getsize(path) - self.header) // (self.frame + 6)

    def luma_planes(self):
        with open(self.path, "rb") as file:
            file.readline()
            while file.readline():
                data = np.frombuffer(file.read(self.frame), np.uint8)
                yield data[: self.luma].reshape(self.height, self.width)

    def repeated(self, times, base):
        """The clip and its motion, so many times."""
        with open(self.path, "rb") as file, open(base + ".y4m", "wb") as out:
            out.write(file.readline())
            frames = file.read()
            for _ in range(times):
                out.write(frames)
        for ending in (".mvp", ".mvn"):
            if os.path.exists(self.base + ending):
                with open(self.base + ending, "rb") as file, open(base + ending, "wb") as out:
                    motion = file.read()
                    for _ in range(times):
                        out.write(motion)
        return Clip(base + ".y4m")


def ours(binary, options, given, clip):
    motion = ""
    if given:
        for flag, ending in (("--motion", ".mvp"), ("--motion-next", ".mvn")):
            # Without B pictures nobody asks for the frame after.
            if os.path.exists(clip.base + ending) and not (ending == ".mvn" and "--bframes 0" in options):
                motion += f" {flag} {clip.base + ending}"
    return f"{binary} {options}{motion} {{point}} {clip.path} -o {{out}}"


def encoders(arguments, clip):
    """Name and command of each; {point} says quantiser or rate, {out} the stream."""
    if arguments.tools:
        best = {name: ours(arguments.binary, f"--effort best {options}" if "--effort" not in options else options, given, clip)
                for name, (options, given) in TOOLS.items()}  # fmt: skip
        return "best", {name: command for name, command in best.items() if arguments.only in name or name == "best"}
    point = "{ffrate}" if arguments.rate else "-qscale:v {q}"
    ffmpeg = {"ffmpeg -g 15 -bf 2": "-g 15 -bf 2", "ffmpeg, default": "", "ffmpeg, slowest": SLOWEST}
    commands = {
        name: FFMPEG.replace("{clip}", clip.path).replace("{options}", f"{options} {point}") for name, options in ffmpeg.items()
    }
    if shutil.which("mpeg2enc") and not arguments.rate:
        for name, options in {"mjpegtools, default": "", "mjpegtools, best": "-R 2 -g 15 -G 15 -4 1 -2 1 -r 32"}.items():
            commands[name] = MJPEG.replace("{clip}", clip.path).replace("{options}", f"{options} -q {{q}}")
    if arguments.rate:
        # The first pass writes what the second reads.
        half = FFMPEG.replace("{clip}", clip.path).replace("{options}", f"{SLOWEST} {{ffrate}} -passlogfile {{out}} -pass {{n}}")
        commands["ffmpeg, slowest, two passes"] = " && ".join(half.replace("{n}", n) for n in "12")
    for name, (options, given) in (OURS | (TWO_PASSES if arguments.rate else {})).items():
        commands[name] = ours(arguments.binary, options, given, clip)
    anchor = "ffmpeg, default" if arguments.rate else "ffmpeg -g 15 -bf 2"
    keep = {name: command for name, command in commands.items() if arguments.only in name or name == anchor}
    return anchor, keep


def fill_in(command, point, out, rate):
    """The command for a bit rate in kbit/s, with a buffer of half a second, or for half of a quantiser_scale."""
    mine = f"--bitrate {point}" if rate else f"--qscale {2 * point}"
    rate = f"-b:v {point}k -maxrate {point}k -minrate {point}k -bufsize {point // 2}k"
    return command.replace("{ffrate}", rate).replace("{q}", str(point)).replace("{point}", mine).replace("{out}", out)


def ssim(a, b):
    a, b = a.astype(np.int64), b.astype(np.int64)
    height, width = a.shape[0] // 4 * 4, a.shape[1] // 4 * 4

    def windows(x):
        x = x[:height, :width].reshape(height // 4, 4, width // 4, 4).sum(axis=(1, 3))
        return (x[:-1, :-1] + x[1:, :-1] + x[:-1, 1:] + x[1:, 1:]).astype(np.float64) / 64

    ma, mb = windows(a), windows(b)
    variances = windows(a * a) + windows(b * b) - ma * ma - mb * mb
    covariance = windows(a * b) - ma * mb
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    return float(((2 * ma * mb + c1) * (2 * covariance + c2) / ((ma * ma + mb * mb + c1) * (variances + c2))).mean())


def quality(stream, clip, metric):
    command = ["ffmpeg", "-v", "error", "-threads", "1", "-f", "mpegvideo", "-i", stream, "-fps_mode", "passthrough"]
    command += ["-pix_fmt", "yuv420p", "-f", "rawvideo", "-"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    error, similarity, count = 0, 0.0, 0
    for truth in clip.luma_planes():
        data = process.stdout.read(clip.frame)
        if len(data) < clip.frame:
            break
        decoded = np.frombuffer(data, np.uint8)[: clip.luma].reshape(clip.height, clip.width)
        error += int(((decoded.astype(np.int32) - truth) ** 2).sum())
        similarity += ssim(decoded, truth) if metric == "ssim" else 0
        count += 1
    rest = process.stdout.read()
    process.wait()
    if count != clip.frames or rest:
        sys.exit(f"{stream}: {count} frames instead of {clip.frames}")
    if metric == "ssim":
        return -10 * np.log10(max(1 - similarity / count, 1e-9))
    return 10 * np.log10(255**2 * count * clip.luma / max(error, 1))


def measure(job):
    command, clip, point, arguments = job
    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/out.m2v"
        run = subprocess.run(fill_in(command, point, out, arguments.rate), shell=True, capture_output=True, text=True)
        if run.returncode != 0:
            print(f"left out, {point}: {command}: {run.stderr}", file=sys.stderr)
            return None
        return os.path.getsize(out) * 8 * clip.fps / clip.frames / 1000, quality(out, clip, arguments.metric)


def slopes(x, y):
    """Of the monotone cubic of Fritsch and Carlson."""
    h, d = np.diff(x), np.diff(y) / np.diff(x)
    m = np.concatenate([d[:1], np.zeros(len(x) - 2), d[-1:]])
    for i in range(1, len(x) - 1):
        if d[i - 1] * d[i] > 0:
            a, b = 2 * h[i] + h[i - 1], h[i] + 2 * h[i - 1]
            m[i] = (a + b) / (a / d[i - 1] + b / d[i])
    return m


def bd_rate(anchor, test):
    """Mean difference of rate at equal quality, per cent."""

    def curve(points):
        points = sorted((q, np.log(r)) for r, q in points)
        keep = [points[0]] + [p for before, p in zip(points, points[1:]) if p[0] > before[0] + 1e-4 and p[1] > before[1]]
        return np.array(keep).T

    if len(test) < 3:
        return np.nan
    (qa, ra), (qt, rt) = curve(anchor), curve(test)
    at = np.linspace(max(qa[0], qt[0]), min(qa[-1], qt[-1]), 2001)

    def value(x, y):
        m, i = slopes(x, y), np.clip(np.searchsorted(x, at, "right") - 1, 0, len(x) - 2)
        h, t = x[i + 1] - x[i], (at - x[i]) / (x[i + 1] - x[i])
        return (
            y[i] * (1 + 2 * t) * (1 - t) ** 2 + h * m[i] * t * (1 - t) ** 2
            + y[i + 1] * t * t * (3 - 2 * t) + h * m[i + 1] * t * t * (t - 1)
        )  # fmt: skip

    difference = value(qt, rt) - value(qa, ra)
    return 100 * (np.exp((difference[1:] + difference[:-1]).mean() / 2) - 1)


def compare_bits(arguments, clips):
    points = RATES if arguments.rate else QUANTISERS
    table = {}
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for clip in clips:
            anchor, commands = encoders(arguments, clip)
            jobs = [(command, clip, point, arguments) for command in commands.values() for point in points]
            results = list(pool.map(measure, jobs))
            curves = {name: results[i * len(points) :][: len(points)] for i, name in enumerate(commands)}
            curves = {name: [point for point in curve if point] for name, curve in curves.items()}
            for name, curve in curves.items():
                table.setdefault(name, {})[clip.name] = bd_rate(curves[anchor], curve)
    if arguments.metric == "psnr" and not arguments.rate and not arguments.tools:
        table.update({name: row for name, row in PUBLISHED.items() if all(clip.name in row for clip in clips)})
    print(f"\nBD-rate ({arguments.metric}) against {anchor}, per cent\n")
    print("| encoder | " + " | ".join(clip.name for clip in clips) + " | mean |\n|---|" + "---|" * (len(clips) + 1))
    for name, row in table.items():
        values = [row[clip.name] for clip in clips]
        print(f"| {name} | " + " | ".join(f"{v:+.1f}" for v in values) + f" | {np.mean(values):+.1f} |")


def cpu_seconds(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, shell=True, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def compare_speed(arguments, clip):
    with tempfile.TemporaryDirectory() as folder:
        long = clip.repeated(-(-300 // clip.frames), f"{folder}/{clip.name}")
        _, commands = encoders(arguments, long)
        commands = {name: fill_in(command, 8, f"{folder}/out.m2v", False) for name, command in commands.items()}
        base = fill_in(FFMPEG.replace("{clip}", long.path).replace("{options}", "-qscale:v {q}"), 8, f"{folder}/out.m2v", False)
        print(f"\nFrames a CPU second, {long.frames} frames of {clip.name}, and times those of ffmpeg's default\n")
        print("| encoder | frames/s | times ffmpeg |\n|---|---|---|")
        for name, command in commands.items():
            pairs = [(cpu_seconds(base), cpu_seconds(command)) for _ in range(arguments.pairs)]
            ratio = statistics.median(b / own for b, own in pairs)
            print(f"| {name} | {long.frames / statistics.median(own for _, own in pairs):.0f} | {ratio:.2f} |", flush=True)


GENERATED = ["fly", "static", "orbit", "pan", "cut", "plain"]


def made_clips(arguments, folder, frames):
    """Clips of so many frames: those of the generator if there is one, and of the shipped scenes."""
    rendered, shipped = (os.path.abspath(f"{folder}/{kind}{frames}") for kind in ("rendered", "shipped"))
    os.makedirs(rendered, exist_ok=True)
    for name in GENERATED if arguments.generator else []:
        if not os.path.exists(f"{rendered}/{name}.y4m"):
            command = [sys.executable, arguments.generator, rendered, name, "--frames", str(frames)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    if not os.path.exists(f"{shipped}/atrium.y4m"):
        command = f"cargo run --release -q -p tests --example clips -- {shipped} 352x288 {frames}"
        subprocess.run(command, shell=True, check=True, cwd=ROOT)
    return [sorted_clips(path) for path in (rendered, shipped)]


def sorted_clips(folder):
    """The clips of a folder, those of the generator in its order."""
    names = [name[:-4] for name in os.listdir(folder) if name.endswith(".y4m")]
    names.sort(key=lambda name: (GENERATED.index(name) if name in GENERATED else len(GENERATED), name))
    return [Clip(f"{folder}/{name}.y4m") for name in names]


def compare_all(arguments):
    """Every table, of clips that are made first."""
    folder = arguments.clips[0]
    sets = [clips for clips in made_clips(arguments, folder, 30) if clips]
    tables = {
        "bits at equal PSNR": {},
        "bits at equal SSIM": {"metric": "ssim"},
        "constant rates": {"rate": True},
        "what each tool is worth": {"tools": True},
    }
    for clips in sets:
        for title, table in tables.items():
            print(f"\n## {len(clips)} clips of 30 frames: {title}", flush=True)
            compare_bits(argparse.Namespace(**{**vars(arguments), **table}), clips)
    for clips in made_clips(arguments, folder, 60):
        if clips:
            print(f"\n## {len(clips)} clips of 60 frames: groups of 60", flush=True)
            compare_bits(argparse.Namespace(**{**vars(arguments), "only": "N=60"}), clips)
    compare_speed(arguments, sets[0][0])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clips", nargs="+", metavar="CLIPS", help="clips, or with --all a folder")
    parser.add_argument("--binary", help="our encoder; built if not given")
    parser.add_argument("--only", default="", help="encoders whose name has this in it, and the anchor")
    parser.add_argument("--metric", choices=["psnr", "ssim"], default="psnr")
    parser.add_argument("--rate", action="store_true", help="constant bit rates of 0.5 to 8 Mbit/s")
    parser.add_argument("--tools", action="store_true", help="ours at its best, without one tool after the other")
    parser.add_argument("--speed", action="store_true", help="CPU seconds of the first clip instead of bits")
    parser.add_argument("--all", action="store_true", help="every table; CLIPS is a folder to make clips in")
    parser.add_argument("--generator", help="with --all, a program that renders six more clips")
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    if not arguments.binary:
        subprocess.run("cargo build --release -p mpeg2enc --example mpeg2enc", shell=True, check=True, cwd=ROOT)
        target = os.environ.get("CARGO_TARGET_DIR", f"{ROOT}/target")
        arguments.binary = f"{target}/release/examples/mpeg2enc"
    if arguments.all:
        return compare_all(arguments)
    clips = [Clip(path) for path in arguments.clips]
    if arguments.speed:
        compare_speed(arguments, clips[0])
    else:
        compare_bits(arguments, clips)


if __name__ == "__main__":
    main()
