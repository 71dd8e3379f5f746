"""Mitsuba 3 with the denoiser OIDN, converged references, and errors against them."""

import flip_evaluator
import mitsuba as mi
import numpy as np
import OpenEXR
import pyoidn

mi.set_variant("llvm_ad_rgb")
import mitsuba_scene  # noqa: E402  needs the variant

import references  # noqa: E402

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class Mitsuba:
    """A scene of Mitsuba at one time, compiled."""

    def __init__(self, path, size, camera, time):
        self.scene = mitsuba_scene.load(path, (size, size), camera, time)
        # Albedo and normals for OIDN.
        self.guides = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})
        self.denoised(self.paths(4, 1), 4)

    def paths(self, spp, seed):
        """Returns a picture with `spp` paths per pixel."""
        return np.array(mi.render(self.scene, spp=spp, seed=seed), np.float32)[..., :3]

    def denoised(self, picture, spp):
        """Returns the picture after OIDN."""
        guides = np.array(mi.render(self.scene, integrator=self.guides, spp=min(spp, 16), seed=77), np.float32)[..., -6:]
        color, albedo, normal = (np.ascontiguousarray(x) for x in (picture, guides[..., :3], guides[..., 3:]))
        return pyoidn.denoise(color, albedo=albedo, normal=normal, hdr=True)


class Reference:
    """Two independent halves of a converged picture."""

    def __init__(self, halves):
        self.halves = [half.astype(float) for half in halves]
        self.whole = sum(self.halves) / 2
        self.mean = (self.whole @ LUMINANCE).mean()

    def tone_mapped(self, picture):
        """Tone-maps a picture for a display."""
        exposure = 0.18 / np.exp(np.log(self.whole @ LUMINANCE + 1e-6).mean())
        light = np.clip(picture * exposure, 0, None)
        light = np.clip(1.6 * light / (1 + light), 0, 1)
        return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)

    def errors(self, picture):
        """Returns relMSE, trimmed relMSE, FLIP and the ratio of means."""
        picture = picture.astype(float)
        a, b = self.halves
        squares = ((picture - a) * (picture - b) / (self.whole**2 + 0.01 * self.mean**2)).mean(axis=-1)
        sorted_squares = np.sort(squares.ravel())
        trimmed = sorted_squares[: -max(1, sorted_squares.size // 1000)].mean()
        flip = flip_evaluator.evaluate(self.tone_mapped(self.whole), self.tone_mapped(picture), "LDR")[1]
        return squares.mean(), trimmed, flip, (picture @ LUMINANCE).mean() / self.mean


def read_exr(path):
    """Returns the radiance of an OpenEXR picture."""
    channels = OpenEXR.File(str(path)).channels()
    picture = channels["RGB"].pixels if "RGB" in channels else channels["RGBA"].pixels[..., :3]
    return picture.astype(float)


def reference(mitsuba, name, scene, view, options):
    """Returns the converged picture of a view (camera, frame), made once."""

    def make(path):
        halves = [0, 0]
        for k in range(2 * options.passes):
            halves[k % 2] = halves[k % 2] + mitsuba.paths(options.spp, 1 + k) / options.passes
        with open(path, "wb") as file:
            np.save(file, np.array(halves, np.float32))

    paths = 2 * options.passes * options.spp
    details = [name, f"{options.size}x{options.size}", view[0], f"frame-{view[1]}", f"{paths}-paths"]
    return Reference(np.load(references.kept(scene, details, ".npy", make)))
