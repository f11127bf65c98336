"""Renders a mesh of water over a chequered ground with Cycles on the CPU. The camera has the keys of a manifest.

    pip install bpy
    python docs/compare/water.py water.obj water.png --eye -2.6 2.6 3.5 --look-at 0.15 0.85 0.05 --ground 0.03

Lengths have the unit of the particle files. y is up unless --up is given. Colours are linear RGB.
All other settings are Blender's defaults.
"""

import argparse
import json
import math
import os
import resource
import time

import bpy
from mathutils import Matrix, Vector


def arguments():
    parser = argparse.ArgumentParser(description="water by Cycles")
    parser.add_argument("mesh", help=".obj, .ply or .stl")
    parser.add_argument("image", help=".png or .exr")

    def vector(name, default, text):
        parser.add_argument(name, type=float, nargs=3, default=default, metavar=("X", "Y", "Z"), help=text)

    vector("--eye", None, "where the camera is")
    vector("--look-at", None, "what is in the middle of the picture")
    vector("--up", (0.0, 1.0, 0.0), "which way is up")
    parser.add_argument("--fov", type=float, default=45.0, help="vertical field of view, degrees")
    parser.add_argument("--size", type=int, nargs=2, default=(1920, 1080))
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--depth", type=int, default=8, help="surface events along a path")
    parser.add_argument("--ior", type=float, default=1.333)
    parser.add_argument("--ground", type=float, help="height of the ground; none without")
    parser.add_argument("--square", type=float, default=0.25, help="edge of a square of the ground")
    vector("--light-square", (0.8, 0.8, 0.8), "its colours")
    vector("--dark-square", (0.3, 0.3, 0.35), "")
    vector("--sky-bottom", (0.45, 0.47, 0.5), "colour straight down; linear in the angle to")
    vector("--sky-top", (0.75, 0.79, 0.85), "colour straight up")
    vector("--sun", (-0.4, 0.8, 0.45), "direction to the sun")
    vector("--sun-color", (1.0, 0.965, 0.91), "")
    parser.add_argument("--sun-strength", type=float, default=1.9)
    parser.add_argument("--denoise", action="store_true", help="by OpenImageDenoise")
    parser.add_argument("--clear-shadows", action="store_true", help="the usual trick: water casts no shadow")
    options = parser.parse_args()
    if options.eye is None or options.look_at is None:
        parser.error("--eye and --look-at are needed")
    return options


def import_mesh(path):
    """The mesh with its coordinates as they are in the file, its own normals if it has some."""
    kind = path.rsplit(".", 1)[-1]
    importer = {"obj": bpy.ops.wm.obj_import, "ply": bpy.ops.wm.ply_import, "stl": bpy.ops.wm.stl_import}[kind]
    importer(filepath=path, forward_axis="Y", up_axis="Z")
    water = bpy.context.selected_objects[0]
    if not water.data.has_custom_normals:
        water.data.shade_smooth()
    return water


def shader(material):
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    return nodes, material.node_tree.links


def water_material(ior, clear_shadows):
    material = bpy.data.materials.new("water")
    nodes, links = shader(material)
    out = nodes.new("ShaderNodeOutputMaterial")
    glass = nodes.new("ShaderNodeBsdfGlass")
    glass.inputs["Roughness"].default_value = 0.0
    glass.inputs["IOR"].default_value = ior
    surface = glass.outputs[0]
    if clear_shadows:
        path, clear, mix = (nodes.new("ShaderNode" + n) for n in ("LightPath", "BsdfTransparent", "MixShader"))
        links.new(path.outputs["Is Shadow Ray"], mix.inputs[0])
        links.new(surface, mix.inputs[1])
        links.new(clear.outputs[0], mix.inputs[2])
        surface = mix.outputs[0]
    links.new(surface, out.inputs["Surface"])
    return material


def frame(up):
    """Turns z to `up`."""
    up = Vector(up).normalized()
    return Vector((0, 0, 1)).rotation_difference(up).to_matrix().to_4x4()


def add_ground(options):
    up = Vector(options.up).normalized()
    bpy.ops.mesh.primitive_plane_add(size=200.0)
    ground = bpy.context.object
    ground.matrix_world = Matrix.Translation(options.ground * up) @ frame(up)
    material = bpy.data.materials.new("ground")
    nodes, links = shader(material)
    out, diffuse, checker, place = (
        nodes.new("ShaderNode" + n) for n in ("OutputMaterial", "BsdfDiffuse", "TexChecker", "TexCoord")
    )
    lift = nodes.new("ShaderNodeVectorMath")  # off the boundary between two layers of the solid checkers
    lift.inputs[1].default_value = (0.0, 0.0, 0.5 * options.square)
    checker.inputs["Color1"].default_value = (*options.light_square, 1)
    checker.inputs["Color2"].default_value = (*options.dark_square, 1)
    checker.inputs["Scale"].default_value = 1.0 / options.square
    links.new(place.outputs["Object"], lift.inputs[0])
    links.new(lift.outputs[0], checker.inputs["Vector"])
    links.new(checker.outputs["Color"], diffuse.inputs["Color"])
    links.new(diffuse.outputs[0], out.inputs["Surface"])
    ground.data.materials.append(material)


def add_sky(options):
    world = bpy.data.worlds.new("sky")
    nodes, links = shader(world)
    out, back, place, dot, angle, part, ramp = (
        nodes.new("ShaderNode" + n)
        for n in ("OutputWorld", "Background", "TexCoord", "VectorMath", "Math", "MapRange", "Mix")
    )
    dot.operation, angle.operation, ramp.data_type = "DOT_PRODUCT", "ARCSINE", "RGBA"
    dot.inputs[1].default_value = Vector(options.up).normalized()
    part.inputs["From Min"].default_value = -math.pi / 2
    part.inputs["From Max"].default_value = math.pi / 2
    colors = [socket for socket in ramp.inputs if socket.type == "RGBA"]
    colors[0].default_value = (*options.sky_bottom, 1)
    colors[1].default_value = (*options.sky_top, 1)
    links.new(place.outputs["Generated"], dot.inputs[0])
    links.new(dot.outputs["Value"], angle.inputs[0])
    links.new(angle.outputs[0], part.inputs["Value"])
    links.new(part.outputs["Result"], ramp.inputs[0])
    links.new(next(socket for socket in ramp.outputs if socket.type == "RGBA"), back.inputs["Color"])
    links.new(back.outputs[0], out.inputs["Surface"])
    bpy.context.scene.world = world


def add_sun(options):
    sun = bpy.data.lights.new("sun", "SUN")
    # A sun of strength pi makes a white diffuse surface that faces it radiate 1.
    sun.energy, sun.color = math.pi * options.sun_strength, options.sun_color
    lamp = bpy.data.objects.new("sun", sun)
    lamp.matrix_world = frame(options.sun)
    bpy.context.collection.objects.link(lamp)


def add_camera(options):
    eye, up = Vector(options.eye), Vector(options.up)
    back = (eye - Vector(options.look_at)).normalized()
    right = up.cross(back).normalized()
    axes = Matrix((right, back.cross(right), back)).transposed()
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle = "VERTICAL", math.radians(options.fov)
    camera.clip_start, camera.clip_end = 1e-3, 1e4
    thing = bpy.data.objects.new("camera", camera)
    thing.matrix_world = Matrix.Translation(eye) @ axes.to_4x4()
    bpy.context.collection.objects.link(thing)
    bpy.context.scene.camera = thing


def settle(scene, options):
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = options.size
    scene.render.resolution_percentage = 100
    scene.render.filepath = os.path.abspath(options.image)
    scene.render.image_settings.file_format = "OPEN_EXR" if options.image.endswith(".exr") else "PNG"
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", options.samples
    cycles.use_adaptive_sampling, cycles.use_denoising = False, options.denoise
    for bounces in ("max_bounces", "glossy_bounces", "transmission_bounces"):
        setattr(cycles, bounces, options.depth)


def main():
    options = arguments()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    start = time.perf_counter()
    water = import_mesh(options.mesh)
    imported = time.perf_counter() - start
    water.data.materials.clear()
    water.data.materials.append(water_material(options.ior, options.clear_shadows))
    if options.ground is not None:
        add_ground(options)
    add_sky(options)
    add_sun(options)
    add_camera(options)
    settle(bpy.context.scene, options)
    start = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    print(json.dumps({
        "blender": bpy.app.version_string,
        "vertices": len(water.data.vertices),
        "triangles": len(water.data.polygons),
        "import_s": round(imported, 2),
        "render_s": round(time.perf_counter() - start, 2),
        "peak_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }))


if __name__ == "__main__":
    main()
