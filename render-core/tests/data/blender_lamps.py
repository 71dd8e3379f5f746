"""Writes blender_lamps.glb with the default options of Blender's exporter, and prints the floor's radiance by Cycles.

Requires Python with Blender's module: pip install bpy; python blender_lamps.py
"""

import math

import bpy
import numpy

WIDTH, HEIGHT, METERS = 128, 32, 32

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene


def material(name, color, emission=0.0):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (color, color, color, 1)
    inputs["Roughness"].default_value = 1.0
    inputs["Specular IOR Level"].default_value = 0.0
    inputs["Emission Color"].default_value = (1, 1, 1, 1)
    inputs["Emission Strength"].default_value = emission
    return made


def plane(name, size, place, rotation, look):
    bpy.ops.mesh.primitive_plane_add(size=size, location=place, rotation=rotation)
    bpy.context.object.name = name
    bpy.context.object.data.materials.append(look)


def lamp(kind, name, energy, place):
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    if kind == "SUN":
        data.angle = 0.0
    else:
        data.shadow_soft_size = 0.0
    if kind == "SPOT":
        data.spot_size, data.spot_blend = 1.0, 0.15
    made = bpy.data.objects.new(name, data)
    made.location = place
    scene.collection.objects.link(made)


plane("floor", 40, (0, 0, 0), (0, 0, 0), material("floor", 0.5))
plane("panel", 1, (-9, 0, 2), (math.pi, 0, 0), material("panel", 0.0, 10.0))
lamp("POINT", "point", 100, (-3, 0, 2))
lamp("SPOT", "spot", 100, (3, 0, 2))
lamp("SUN", "sun", 0.05, (0, 0, 9))

data = bpy.data.cameras.new("camera")
data.type, data.ortho_scale = "ORTHO", METERS
camera = bpy.data.objects.new("camera", data)
camera.location = (0, 0, 30)
scene.collection.objects.link(camera)
scene.camera = camera
render = scene.render
render.resolution_x, render.resolution_y = WIDTH, HEIGHT

bpy.ops.export_scene.gltf(filepath="blender_lamps.glb", export_lights=True, export_cameras=True)

render.engine = "CYCLES"
scene.cycles.samples = 4096
scene.cycles.use_denoising = False
scene.cycles.use_adaptive_sampling = False
# Render direct light only.
scene.cycles.max_bounces = 0
scene.view_settings.view_transform = "Raw"
render.image_settings.file_format = "OPEN_EXR"
render.image_settings.color_depth = "32"
render.filepath = "/tmp/blender_lamps.exr"
render.threads_mode, render.threads = "FIXED", 1
bpy.ops.render.render(write_still=True)
image = bpy.data.images.load(render.filepath)
pixels = numpy.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)[..., 0]
for name, x in [("panel", -7), ("point", -3), ("spot", 3), ("sun", 13)]:
    column = round((x / METERS + 0.5) * WIDTH)
    block = pixels[14:18, column - 2 : column + 2]
    print(f"{name} {x} {block.mean():.5f} {block.std():.5f}")
