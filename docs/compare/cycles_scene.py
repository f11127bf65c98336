"""Renders one scene of path_tracing.py with Cycles on the CPU: python cycles_scene.py scene.json

The scene has z up. Prints the seconds of the render without start-up as JSON.
"""

import json
import math
import resource
import sys
import time

import bpy
import numpy
from mathutils import Matrix, Vector
from water import add_camera, import_mesh, shader, water_material


class Camera:
    """What `add_camera` of water.py needs."""

    def __init__(self, scene):
        self.eye, self.look_at, self.fov = scene["eye"], scene["look_at"], scene["fov"]
        self.up = (0.0, 0.0, 1.0)


def matte(color):
    material = bpy.data.materials.new("matte")
    nodes, links = shader(material)
    out, diffuse = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (*color, 1)
    diffuse.inputs["Roughness"].default_value = 0.0  # Lambert's law
    links.new(diffuse.outputs[0], out.inputs["Surface"])
    return material


def metal(color, roughness):
    """Schlick's approximation: an edge tint of 1 turns the correction of F82 off."""
    material = bpy.data.materials.new("metal")
    nodes, links = shader(material)
    out, surface = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfMetallic")
    surface.fresnel_type, surface.distribution = "F82", "MULTI_GGX"
    surface.inputs["Base Color"].default_value = (*color, 1)
    surface.inputs["Edge Tint"].default_value = (1, 1, 1, 1)
    surface.inputs["Roughness"].default_value = roughness
    links.new(surface.outputs[0], out.inputs["Surface"])
    return material


def particle_material(scene):
    return metal(scene["color"], scene["roughness"]) if scene["material"] == "metal" else matte(scene["color"])


def add_spheres(scene):
    """A point cloud, which Cycles intersects as exact spheres. Only geometry nodes can make one."""
    positions = numpy.load(scene["particles"]).astype(numpy.float32)
    mesh = bpy.data.meshes.new("particles")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.ravel())
    tree = bpy.data.node_groups.new("spheres", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, points, material, end = (
        tree.nodes.new(kind)
        for kind in ("NodeGroupInput", "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial", "NodeGroupOutput")
    )
    points.inputs["Radius"].default_value = scene["radius"]
    material.inputs["Material"].default_value = particle_material(scene)
    for source, target in ((start, points), (points, material), (material, end)):
        tree.links.new(source.outputs[0], target.inputs[0])
    thing = bpy.data.objects.new("particles", mesh)
    thing.modifiers.new("spheres", "NODES").node_group = tree
    bpy.context.collection.objects.link(thing)


def add_water(scene):
    water = import_mesh(scene["mesh"])
    # import_mesh keeps the coordinates of the file, whose y is up
    water.matrix_world = Matrix.Rotation(math.pi / 2, 4, "X")
    water.data.materials.clear()
    water.data.materials.append(water_material(scene["ior"], clear_shadows=False))


def add_ground(ground):
    bpy.ops.mesh.primitive_plane_add(size=ground["size"], location=(0.0, 0.0, ground["height"]))
    bpy.context.object.data.materials.append(matte(ground["color"]))


def add_environment(path, intensity):
    world = bpy.data.worlds.new("environment")
    nodes, links = shader(world)
    out, back, image, turn, place = (
        nodes.new("ShaderNode" + n) for n in ("OutputWorld", "Background", "TexEnvironment", "Mapping", "TexCoord")
    )
    back.inputs["Strength"].default_value = intensity
    image.image = bpy.data.images.load(path)
    image.image.colorspace_settings.name = "Linear Rec.709"
    # The centre of the image is along x for Blender, and along y for spherule
    turn.inputs["Rotation"].default_value = (0.0, 0.0, -math.pi / 2)
    links.new(place.outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs[0], image.inputs["Vector"])
    links.new(image.outputs["Color"], back.inputs["Color"])
    links.new(back.outputs[0], out.inputs["Surface"])
    world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 512
    bpy.context.scene.world = world


def add_light(light):
    """A light of a manifest of spherule. Blender's unit is watts, or watts per square metre for suns."""
    kind, intensity = light["type"], light["intensity"]
    data = bpy.data.lights.new(kind, {"rect": "AREA", "disc": "AREA", "sun": "SUN"}.get(kind, "POINT"))
    data.color = light["color"]
    if kind == "rect":
        data.shape, data.size, data.size_y = "RECTANGLE", light["width"], light["height"]
        data.energy = math.pi * light["width"] * light["height"] * intensity
    elif kind == "disc":
        data.shape, data.size = "DISK", 2.0 * light["radius"]
        data.energy = math.pi**2 * light["radius"] ** 2 * intensity
    elif kind == "sun":
        data.angle, data.energy = math.radians(light["size"]), intensity
    else:
        radius = light.get("radius", 0.0)
        data.shadow_soft_size, data.use_soft_falloff = radius, False
        # Radiance of a sphere, or intensity of a point
        data.energy = 4.0 * math.pi * intensity * (math.pi * radius**2 if radius > 0.0 else 1.0)
    lamp = bpy.data.objects.new(kind, data)
    lamp.visible_camera = False
    back = -Vector(light.get("direction", (0.0, 0.0, -1.0))).normalized()
    right = Vector((0.0, 0.0, 1.0)).cross(back) if abs(back.z) < 1.0 else Vector((1.0, 0.0, 0.0))
    right.normalize()
    axes = Matrix((right, back.cross(right), back)).transposed()
    lamp.matrix_world = Matrix.Translation(light.get("position", (0.0, 0.0, 0.0))) @ axes.to_4x4()
    bpy.context.collection.objects.link(lamp)


def settle(scene):
    target = bpy.context.scene
    target.render.engine = "CYCLES"
    target.render.resolution_x, target.render.resolution_y = scene["size"]
    target.render.resolution_percentage = 100
    target.render.filepath = scene["image"]
    target.render.dither_intensity = 0.0
    image = target.render.image_settings
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR", "32", "ZIP"
    image.color_mode = "RGB"
    target.view_settings.view_transform = "Raw"
    cycles = target.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", scene["samples"], scene.get("seed", 0)
    cycles.use_adaptive_sampling, cycles.use_denoising = False, False
    cycles.pixel_filter_type = "BOX"
    # No shortcuts that change the mean
    cycles.sample_clamp_direct, cycles.sample_clamp_indirect = 0.0, 0.0
    cycles.light_sampling_threshold, cycles.blur_glossy = 0.0, 0.0
    cycles.use_fast_gi = False
    cycles.caustics_reflective, cycles.caustics_refractive = True, True
    # Both programs count reflections before the last one
    cycles.diffuse_bounces = scene["bounces"]
    cycles.max_bounces = scene["bounces"] + scene["crossings"]
    cycles.glossy_bounces = cycles.transmission_bounces = cycles.max_bounces


def user_seconds():
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def main():
    with open(sys.argv[1]) as file:
        scene = json.load(file)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if scene.get("mesh"):
        add_water(scene)
    else:
        add_spheres(scene)
    add_ground(scene["ground"])
    add_environment(scene["environment"], scene["intensity"])
    for light in scene.get("lights", []):
        add_light(light)
    add_camera(Camera(scene))
    settle(scene)
    user, wall = user_seconds(), time.perf_counter()
    bpy.ops.render.render(write_still=True)
    print(json.dumps({
        "blender": bpy.app.version_string,
        "render_user_s": user_seconds() - user,
        "render_wall_s": time.perf_counter() - wall,
        "peak_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }))


if __name__ == "__main__":
    main()
