#!/usr/bin/env python3
"""Compares one of our reference pictures with Mitsuba 3, a renderer that shares no code with it.

    render2mpeg reference SCENE.glb --size 128x128 --spp 512 -o ours.exr
    python3 bench/compare_mitsuba.py SCENE.glb ours.exr

SCENE is a .glb of Lambert surfaces, glass with a volume, and area lights, shown at time 0. Mitsuba renders it `--seeds` times with `--spp` paths
per pixel and a box filter. Both pictures are averaged over blocks of 16x16 pixels. Standard errors follow from Mitsuba's
seeds and from the variance channels of our picture.

The output is the largest |difference| / standard error of all blocks and channels. The root mean square of all of them should
be about 1. The exit code is 1 if a block is off by more than `--limit` standard errors.

Results, as largest |z| and rms:

    scenes/cornell/cornell.glb (--block 8 --spp 4)    3.11, 0.95
    McGuire's CornellBox-Original                     2.81, 1.18
    box with a ball of glass (--spp 1024 of ours)     3.44, 1.04
    box with a block of tinted glass                  2.85, 1.12
    box with a ball of glass of roughness 0.35        8.98, 3.11

In the second scene the lamp is a centimeter below the ceiling and emits upwards, too. Rare bright paths escape through the gap,
and a few groups of samples underestimate their variance. Rough glass differs in its model: ours returns the light that is
scattered repeatedly between facets, 1 % of the mean, and its masking is correlated by height. Blocks of 8x8 pixels are too small to average them out.

Requires numpy, pillow and mitsuba. Exit code 77: one of them is missing.
"""

import argparse
import sys

try:
    import mitsuba as mi
    import numpy as np

    # The vectorized variants require LLVM, which many machines lack.
    mi.set_variant("scalar_rgb")
    import mitsuba_scene
except ImportError as error:
    print(f"left out: {error}")
    sys.exit(77)


def channels(path):
    """Returns the named channels of an EXR file."""
    bitmap = mi.Bitmap(path)
    data = np.array(bitmap, np.float64)
    names = [field.name for field in bitmap.struct_()]
    return {name: data[:, :, i] for i, name in enumerate(names)}


def picture_and_variance(path):
    """Returns the colors of our picture, and their variance."""
    named = channels(path)
    return [np.stack([named[f"{prefix}{c}"] for c in "RGB"], axis=-1) for prefix in ("", "variance.")]


def blocks(picture, side):
    """Returns the means over blocks of side x side pixels; incomplete blocks at the borders are dropped."""
    rows, columns = picture.shape[0] // side, picture.shape[1] // side
    return picture[: rows * side, : columns * side].reshape(rows, side, columns, side, -1).mean(axis=(1, 3))


def rendered(arguments, shape):
    """Returns Mitsuba's block means, one array for each seed."""
    height, width = shape
    scene = mitsuba_scene.load(arguments.scene, (width, height), roulette=12, sampler="independent")
    runs, total = [], 0
    for seed in range(arguments.seeds):
        picture = np.array(mi.render(scene, spp=arguments.spp, seed=1000 + seed), np.float64)
        total = total + picture
        runs.append(blocks(picture, arguments.block))
    if arguments.write:
        mi.Bitmap((total / arguments.seeds).astype(np.float32)).write(arguments.write)
    return np.array(runs)


def compare(arguments):
    """Prints the differences of the pictures, and returns the largest in standard errors."""
    ours, variance = picture_and_variance(arguments.ours)
    side = arguments.block
    runs = rendered(arguments, ours.shape[:2])
    theirs, their_variance = runs.mean(axis=0), runs.var(axis=0, ddof=1) / arguments.seeds
    own, own_variance = blocks(ours, side), blocks(variance, side) / side**2
    error = np.sqrt(their_variance + own_variance)
    z = (own - theirs) / np.maximum(error, 1e-6 * theirs.mean())
    worst = np.unravel_index(np.abs(z).argmax(), z.shape)
    print(
        f"{z.size} block means of {side}x{side} pixels: largest |z| {np.abs(z[worst]):.2f} "
        f"(block {worst[1]},{worst[0]} channel {'RGB'[worst[2]]}: {own[worst]:.6g} and {theirs[worst]:.6g}), "
        f"rms z {np.sqrt((z**2).mean()):.3f}, mean ratio {own.mean() / theirs.mean():.5f}, "
        f"standard error {error.mean() / theirs.mean():.2%} of the mean"
    )
    return np.abs(z).max()


def parser():
    """Returns the command line."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("scene")
    options.add_argument("ours")
    options.add_argument("--spp", type=int, default=16)
    options.add_argument("--seeds", type=int, default=64)
    options.add_argument("--block", type=int, default=16)
    options.add_argument("--limit", type=float, default=4.0)
    options.add_argument("--write", metavar="EXR", help="also write Mitsuba's picture")
    return options


def main():
    """Returns exit code 0 if the pictures agree."""
    arguments = parser().parse_args()
    sys.exit(0 if compare(arguments) <= arguments.limit else 1)


if __name__ == "__main__":
    main()
