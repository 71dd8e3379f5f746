"""Renders a glTF model with F3D's defaults and a given camera, as a PNG; run by `peers`.

    python3 bench/f3d_still.py JOB

JOB is a JSON object, as in gltf_views.mjs.
"""

import json
import math
import sys

import f3d

job = json.loads(sys.argv[1])
f3d.Engine.autoload_plugins()
engine = f3d.Engine.create_osmesa()
engine.window.size = job["width"], job["height"]
engine.scene.add(job["file"])

# Derive position and axes from the rows of the matrix, which is stored by columns.
matrix = job["camera_from_world"]
rows = [[matrix[4 * column + line] for column in range(3)] for line in range(3)]
position = [-sum(rows[line][axis] * matrix[12 + line] for line in range(3)) for axis in range(3)]
# The distance of the focal point affects no picture.
camera = engine.window.camera
camera.position = position
camera.focal_point = [position[axis] - rows[2][axis] for axis in range(3)]
camera.view_up = rows[1]
camera.view_angle = 2 * math.degrees(math.atan(1 / job["projection"][5]))
engine.window.render_to_image().save(job["output"])
