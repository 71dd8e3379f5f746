#!/usr/bin/env python3
"""Compares a reference picture of ours with Mitsuba 3, a renderer that shares no code with it.

    render2mpeg reference SCENE.glb --size 128x128 --spp 512 -o ours.exr
    python3 bench/compare_mitsuba.py SCENE.glb ours.exr

Found that way: largest |z| 3.11, rms 0.95 for scenes/cornell/cornell.glb (with --block 8 --spp 4); largest |z| 2.81, rms 1.18 for McGuire's
CornellBox-Original. There the lamp hangs a centimetre below the ceiling and shines up, too: what escapes through the gap are rare
bright paths, whose variance a few groups of samples underestimate; blocks of 8x8 pixels (--block 8) are too small for them to even out.

SCENE is a .glb of Lambert surfaces and area lights, shown at time 0. Mitsuba renders it `--seeds` times with `--spp` paths a
pixel and a box filter. Both pictures are averaged over blocks of 16x16 pixels; standard errors follow from Mitsuba's seeds and from
the variance channels of ours. Printed is the largest |difference| / standard error of all blocks and channels, and the root mean
square of all of them, which should be about 1. The exit code is 1 when a block is off by more than `--limit` standard errors.

Needs numpy, pillow and mitsuba. Exit code 77: one of them is missing.
"""

import argparse
import sys

try:
    import mitsuba as mi
    import numpy as np

    # The vectorised variants need an LLVM that not every machine has.
    mi.set_variant("scalar_rgb")
    import mitsuba_scene
except ImportError as error:
    print(f"left out: {error}")
    sys.exit(77)


def channels(path):
    """Named channels of an EXR file."""
    bitmap = mi.Bitmap(path)
    data = np.array(bitmap, np.float64)
    names = [field.name for field in bitmap.struct_()]
    return {name: data[:, :, i] for i, name in enumerate(names)}


def blocks(picture, side):
    """Means over blocks of side x side pixels; what is left over at the borders is not used."""
    rows, columns = picture.shape[0] // side, picture.shape[1] // side
    return picture[: rows * side, : columns * side].reshape(rows, side, columns, side, -1).mean(axis=(1, 3))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("ours")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=64)
    parser.add_argument("--block", type=int, default=16)
    parser.add_argument("--limit", type=float, default=4.0)
    parser.add_argument("--write", metavar="EXR", help="also write Mitsuba's picture")
    arguments = parser.parse_args()

    named = channels(arguments.ours)
    ours = np.stack([named[c] for c in "RGB"], axis=-1)
    variance = np.stack([named[f"variance.{c}"] for c in "RGB"], axis=-1)
    height, width = ours.shape[:2]
    scene = mitsuba_scene.load(arguments.scene, (width, height), roulette=12, sampler="independent")
    runs, total = [], 0
    for seed in range(arguments.seeds):
        picture = np.array(mi.render(scene, spp=arguments.spp, seed=1000 + seed), np.float64)
        total = total + picture
        runs.append(blocks(picture, arguments.block))
    if arguments.write:
        mi.Bitmap((total / arguments.seeds).astype(np.float32)).write(arguments.write)

    runs = np.array(runs)
    theirs, their_variance = runs.mean(axis=0), runs.var(axis=0, ddof=1) / arguments.seeds
    our_blocks = blocks(ours, arguments.block)
    our_variance = blocks(variance, arguments.block) / arguments.block**2
    error = np.sqrt(their_variance + our_variance)
    z = (our_blocks - theirs) / np.maximum(error, 1e-6 * theirs.mean())
    worst = np.unravel_index(np.abs(z).argmax(), z.shape)
    relative = error.mean() / theirs.mean()
    print(
        f"{z.size} block means of {arguments.block}x{arguments.block} pixels: largest |z| {np.abs(z[worst]):.2f} "
        f"(block {worst[1]},{worst[0]} channel {'RGB'[worst[2]]}: {our_blocks[worst]:.6g} and {theirs[worst]:.6g}), "
        f"rms z {np.sqrt((z**2).mean()):.3f}, mean ratio {our_blocks.mean() / theirs.mean():.5f}, "
        f"standard error {relative:.2%} of the mean"
    )
    sys.exit(0 if np.abs(z).max() <= arguments.limit else 1)


if __name__ == "__main__":
    main()
