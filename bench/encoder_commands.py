"""Command lines of the MPEG-2 encoders."""

import shutil
from dataclasses import dataclass
from pathlib import Path

SLOWEST = (
    "-g 15 -bf 2 -b_strategy 2 -mbd rd -trellis 2 -cmp 2 -subcmp 2 -mbcmp 2 -precmp 2 -dia_size 4 -pre_dia_size 4 -mepre 2 "
    "-last_pred 3 -bidir_refine 4 -mpv_flags +skip_rd+mv0"
)
TWO_B = "ffmpeg -g 15 -bf 2"
DEFAULT = "ffmpeg, default"
FFMPEG = {TWO_B: "-g 15 -bf 2", DEFAULT: "", "ffmpeg, slowest": SLOWEST}
MJPEGTOOLS = {"mjpegtools, default": "", "mjpegtools, best": "-R 2 -g 15 -G 15 -4 1 -2 1 -r 32"}
# Our options, and whether the motion is provided.
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
# Used only with a requested rate, without a bound on the distribution of bits.
TWO_PASSES = {
    "ours, balanced, two passes": ("--effort balanced --two-pass", True),
    "ours, best, two passes": ("--effort best --two-pass", True),
}
# Our best options without one tool, or with a replacement. The first entry is the anchor.
BEST = "best"
TOOLS = {
    BEST: ("--effort best", True),
    "motion searched": ("--effort best", False),
    "no B pictures": ("--effort best --bframes 0", True),
    "one B picture in a row": ("--effort best --bframes 1", True),
    "one quantiser a picture: no tree, no quantiser choice": ("--effort best --uniform", True),
    "no I pictures at new scenes": ("--effort best --no-scene-cuts", True),
    "Table B.14 for intra blocks": ("--effort best --no-intra-vlc", True),
    "alternate scan": ("--effort best --alternate-scan", True),
    "intra DC of 10 bits": ("--effort best --dc 10", True),
    "groups of 60": ("--effort best --gop 60", True),
    "balanced: no quantiser choice, quick decisions": ("--effort balanced", True),
    "fast: no macroblock-tree, no trellis either": ("--effort fast", True),
}
# BD-rates [%] by clip of an encoder that is not run here.
PUBLISHED = {
    "y262, published": {"fly": -17.1, "static": -31.5, "orbit": -18.1, "pan": -17.1, "cut": -19.2, "plain": -17.8},
}


@dataclass(frozen=True)
class Point:
    """Target of a stream: half of a quantiser_scale, or a constant rate [kbit/s] with a buffer of half a second."""

    value: int
    is_rate: bool = False

    def for_ffmpeg(self):
        """Options of ffmpeg."""
        if not self.is_rate:
            return ["-qscale:v", str(self.value)]
        rate = f"{self.value}k"
        return ["-b:v", rate, "-maxrate", rate, "-minrate", rate, "-bufsize", f"{self.value // 2}k"]

    def for_ours(self):
        """Options of our encoder."""
        return ["--bitrate", str(self.value)] if self.is_rate else ["--qscale", str(2 * self.value)]


@dataclass(frozen=True)
class Step:
    """A program to run, and the file for its standard input, if any."""

    words: list
    stdin: Path = None


@dataclass(frozen=True)
class Ffmpeg:
    """ffmpeg's encoder with some options, in one pass or in two."""

    options: str
    passes: int = 1

    def steps(self, clip, point, out):
        """Returns the programs to run, in order."""
        for number in range(1, self.passes + 1):
            words = ["ffmpeg", "-nostdin", "-v", "error", "-y", "-threads", "1", "-i", clip.path, "-c:v", "mpeg2video"]
            words += ["-threads", "1", "-qmin", "1", *self.options.split(), *point.for_ffmpeg()]
            if self.passes > 1:
                words += ["-passlogfile", out, "-pass", str(number)]
            yield Step([*words, "-f", "mpeg2video", out])


@dataclass(frozen=True)
class Mjpegtools:
    """mpeg2enc of mjpegtools with some options, without rates."""

    options: str

    def steps(self, clip, point, out):
        """Returns the programs to run, in order."""
        words = "mpeg2enc -v 0 -f 3 --no-constraints -I 0 -a 1 -b 60000 -V 2000".split()
        yield Step([*words, *self.options.split(), "-q", str(point.value), "-o", out], clip.path)


@dataclass(frozen=True)
class Ours:
    """Our encoder with some options, with or without the clip's motion."""

    binary: Path
    options: str
    given: bool

    def motion(self, clip):
        """Returns the options for known motion. Without B pictures, motion to the next frame is not needed."""
        asked = {"--motion": ".mvp"} if "--bframes 0" in self.options else {"--motion": ".mvp", "--motion-next": ".mvn"}
        found = {flag: clip.motion(ending) for flag, ending in asked.items()} if self.given else {}
        return [word for flag, path in found.items() if path for word in (flag, path)]

    def steps(self, clip, point, out):
        """Returns the programs to run, in order."""
        words = [self.binary, *self.options.split(), *self.motion(clip), *point.for_ours(), clip.path]
        yield Step([*words, "-o", out])


def ours(binary, table):
    """Returns our encoders by a table of options."""
    return {name: Ours(binary, options, given) for name, (options, given) in table.items()}


def all_encoders(binary, rates):
    """Returns the anchor's name, and the encoders by name; with `rates`, only encoders with rate control."""
    found = {name: Ffmpeg(options) for name, options in FFMPEG.items()}
    if rates:
        found["ffmpeg, slowest, two passes"] = Ffmpeg(SLOWEST, passes=2)
        return DEFAULT, found | ours(binary, OURS | TWO_PASSES)
    if shutil.which("mpeg2enc"):
        found |= {name: Mjpegtools(options) for name, options in MJPEGTOOLS.items()}
    return TWO_B, found | ours(binary, OURS)


def all_tools(binary):
    """Returns the anchor's name, and our encoder at its best with each tool removed in turn."""
    return BEST, ours(binary, TOOLS)
