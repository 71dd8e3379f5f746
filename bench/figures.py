"""Figures of pictures: PSNR and SSIM by `render2mpeg compare`, and flicker."""

import json
import math
from dataclasses import dataclass
from operator import sub

from running import run

PEAK = 255


@dataclass
class Likeness:
    """Similarity of two films: PSNR of luma over all frames [dB], and mean SSIM of luma."""

    psnr: float
    ssim: float


def compare(program, film, reference):
    """Compares two films of equal length, in any format that `render2mpeg compare` reads."""
    found = json.loads(run([program, "compare", film, reference, "--json"]).output)
    # The PSNR of equal frames is null.
    known = [frame["psnr_y"] for frame in found["frames"]]
    squares = [0 if psnr is None else PEAK**2 / 10 ** (psnr / 10) for psnr in known]
    mean = sum(squares) / len(squares)
    return Likeness(10 * math.log10(PEAK**2 / mean) if mean else math.inf, found["mean"]["ssim"])


def decode(video, target):
    """Decodes a video into a YUV4MPEG2 file."""
    words = ["ffmpeg", "-nostdin", "-v", "error", "-y", "-i", video, "-fps_mode", "passthrough", "-pix_fmt", "yuv420p"]
    run([*words, target])
    return target


def lumas(path):
    """Yields the luma planes of a YUV4MPEG2 file with 4:2:0 chroma."""
    with open(path, "rb") as file:
        tags = {word[:1]: word[1:] for word in file.readline().decode().split()[1:]}
        width, height = int(tags["W"]), int(tags["H"])
        chroma = 2 * ((width + 1) // 2) * ((height + 1) // 2)
        while file.readline():
            yield file.read(width * height)
            file.read(chroma)


def flicker(path):
    """Returns the mean change of luma between frames of a YUV4MPEG2 file [code values]."""
    planes = list(lumas(path))
    changes = [sum(map(abs, map(sub, a, b))) / len(a) for a, b in zip(planes, planes[1:])]
    return sum(changes) / len(changes)
