"""Writes the path of the active camera of a Blender scene as keyframes for `spherule render --camera-path`.

    blender --background shot.blend --python examples/blender_camera.py -- shot.json

Each frame of the scene becomes one keyframe. With the package `bpy` from PyPI, the script also runs without Blender:

    python examples/blender_camera.py shot.blend shot.json
"""

import json
import math
import sys

import bpy


def keyframe(scene):
    """The view of the camera at the current frame: position, a point on its axis, up, and vertical field of view."""
    camera = scene.camera.evaluated_get(bpy.context.evaluated_depsgraph_get())
    eye, rotation, _ = camera.matrix_world.decompose()
    # A camera looks along its -z axis, and its y axis is up. The point on the axis is at the distance of the focus, or
    # at 1; it is what `camera.focus = "auto"` focuses on.
    axes = rotation.to_matrix()
    distance = camera.data.dof.focus_distance if camera.data.dof.use_dof else 1.0
    look_at = eye - distance * axes.col[2]
    # The projection scales y by 1 / tan(fov / 2)
    render = scene.render
    projection = camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(), x=render.resolution_x, y=render.resolution_y
    )
    fov = math.degrees(2 * math.atan(1 / projection[1][1]))
    return {
        "frame": scene.frame_current,
        "eye": list(eye),
        "look_at": list(look_at),
        "up": list(axes.col[1]),
        "fov": fov,
    }


def main(arguments):
    if arguments and arguments[0].endswith(".blend"):
        bpy.ops.wm.open_mainfile(filepath=arguments.pop(0))
    if len(arguments) != 1:
        sys.exit("usage: blender --background shot.blend --python blender_camera.py -- shot.json")
    scene = bpy.context.scene
    if scene.camera is None or scene.camera.data.type != "PERSP":
        sys.exit("the scene has no active camera with perspective")
    keys = []
    for frame in range(scene.frame_start, scene.frame_end + 1, scene.frame_step):
        scene.frame_set(frame)
        keys.append(keyframe(scene))
    with open(arguments[0], "w", encoding="utf-8") as file:
        json.dump(keys, file, indent=1)
    print(f"{len(keys)} keyframes in {arguments[0]}")


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    main(given)
