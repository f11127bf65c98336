"""Renders one scene of the other scripts with Cycles on the CPU: python cycles_scene.py scene.json

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
    if scene["material"] == "metal":
        return metal(scene["color"], scene["roughness"])
    if scene["material"] == "glass":
        return water_material(scene["ior"], clear_shadows=False)
    return matte(scene["color"])


def add_spheres(positions, radius, surface):
    """A point cloud, which Cycles intersects as exact spheres. Only geometry nodes can make one.

    A row of `positions` is x, y and z, and the radius unless all have the same one.
    """
    positions = positions.astype(numpy.float32)
    if positions.shape[1] == 3:
        positions = numpy.column_stack([positions, numpy.full(len(positions), radius, numpy.float32)])
    mesh = bpy.data.meshes.new("particles")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions[:, :3].ravel())
    mesh.attributes.new("size", "FLOAT", "POINT").data.foreach_set("value", positions[:, 3].copy())
    tree = bpy.data.node_groups.new("spheres", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, points, material, end = (
        tree.nodes.new(kind)
        for kind in ("NodeGroupInput", "GeometryNodeMeshToPoints", "GeometryNodeSetMaterial", "NodeGroupOutput")
    )
    size = tree.nodes.new("GeometryNodeInputNamedAttribute")
    size.data_type, size.inputs["Name"].default_value = "FLOAT", "size"
    tree.links.new(size.outputs[0], points.inputs["Radius"])
    material.inputs["Material"].default_value = surface
    for source, target in ((start, points), (points, material), (material, end)):
        tree.links.new(source.outputs[0], target.inputs[0])
    thing = bpy.data.objects.new("particles", mesh)
    thing.modifiers.new("spheres", "NODES").node_group = tree
    bpy.context.collection.objects.link(thing)


def add_glass_spheres(spheres, surface):
    """Meshes: a refracted ray inside a point of a point cloud does not hit the same point from within."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=7, radius=1.0, enter_editmode=False)
    first = bpy.context.object
    first.data.shade_smooth()
    first.data.materials.append(surface)
    for index, (x, y, z, radius) in enumerate(spheres.tolist()):
        ball = first if index == 0 else bpy.data.objects.new("ball", first.data)
        if index > 0:
            bpy.context.collection.objects.link(ball)
        ball.location, ball.scale = (x, y, z), (radius, radius, radius)


def add_water(scene):
    water = import_mesh(scene["mesh"])
    # import_mesh keeps the coordinates of the file, whose y is up
    water.matrix_world = Matrix.Rotation(math.pi / 2, 4, "X")
    water.data.materials.clear()
    water.data.materials.append(water_material(scene["ior"], clear_shadows=False))


def add_mesh(settings):
    """A matte mesh of a manifest of spherule, with the coordinates of its file."""
    mesh = import_mesh(settings["path"])
    mesh.data.shade_flat()
    mesh.data.materials.clear()
    mesh.data.materials.append(matte(settings["color"]))


def add_ground(ground):
    bpy.ops.mesh.primitive_plane_add(size=ground["size"], location=(0.0, 0.0, ground["height"]))
    bpy.context.object.data.materials.append(matte(ground["color"]))


def add_constant_environment(color, intensity):
    world = bpy.data.worlds.new("environment")
    nodes, links = shader(world)
    out, back = nodes.new("ShaderNodeOutputWorld"), nodes.new("ShaderNodeBackground")
    back.inputs["Color"].default_value = (*color, 1)
    back.inputs["Strength"].default_value = intensity
    links.new(back.outputs[0], out.inputs["Surface"])
    bpy.context.scene.world = world


def add_sky(sky):
    """A sky texture and its sun, which is in the direction of `azimuth`: 0 along x, 90 along y."""
    world = bpy.data.worlds.new("sky")
    nodes, links = shader(world)
    out, back, texture = (nodes.new("ShaderNode" + n) for n in ("OutputWorld", "Background", "TexSky"))
    texture.sky_type, texture.sun_disc = sky["model"], sky["sun"]
    texture.sun_size, texture.sun_elevation = math.radians(sky["size"]), math.radians(sky["elevation"])
    texture.sun_rotation = math.radians(90.0 - sky["azimuth"])  # clockwise from y
    # The older models have these settings instead
    elevation, azimuth = math.radians(sky["elevation"]), math.radians(sky["azimuth"])
    level = math.cos(elevation)
    texture.sun_direction = (level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation))
    texture.turbidity, texture.ground_albedo = sky["turbidity"], sky["albedo"]
    links.new(texture.outputs["Color"], back.inputs["Color"])
    links.new(back.outputs[0], out.inputs["Surface"])
    bpy.context.scene.world = world


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
    world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 2048
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
    lamp.visible_camera = light.get("visible", False)
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
    cycles.use_adaptive_sampling, cycles.use_denoising = False, scene.get("denoise", False)
    cycles.denoiser, cycles.denoising_input_passes = "OPENIMAGEDENOISE", "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter, cycles.denoising_quality = "ACCURATE", "HIGH"
    if "threads" in scene:
        target.render.threads_mode, target.render.threads = "FIXED", scene["threads"]
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
    elif scene["material"] == "glass":
        add_glass_spheres(numpy.load(scene["particles"]), particle_material(scene))
    else:
        add_spheres(numpy.load(scene["particles"]), scene["radius"], particle_material(scene))
    if scene.get("spray"):
        add_spheres(numpy.load(scene["spray"]), scene["spray_radius"], matte([scene["spray_color"]] * 3))
    for mesh in scene.get("meshes", []):
        add_mesh(mesh)
    if scene.get("ground"):
        add_ground(scene["ground"])
    if "sky" in scene:
        add_sky(scene["sky"])
    elif isinstance(scene["environment"], str):
        add_environment(scene["environment"], scene["intensity"])
    else:
        add_constant_environment(scene["environment"], scene["intensity"])
    for light in scene.get("lights", []):
        add_light(light)
    add_camera(Camera(scene))
    if scene.get("panorama"):
        camera = bpy.context.scene.camera.data
        camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
    settle(scene)
    user, wall = user_seconds(), time.perf_counter()
    bpy.ops.render.render(write_still=True)
    print(
        json.dumps(
            {
                "blender": bpy.app.version_string,
                "render_user_s": user_seconds() - user,
                "render_wall_s": time.perf_counter() - wall,
                "peak_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
            }
        )
    )


if __name__ == "__main__":
    main()
