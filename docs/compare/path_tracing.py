"""Renders the same scenes with the path tracers of spherule and Cycles, and compares pictures, noise and time.

    pip install bpy pysplashsurf numpy OpenEXR pillow     # bpy 4.5 needs Python 3.11
    python docs/compare/path_tracing.py dam_break_frame_23_24389_particles.bgeo out --spherule target/release/spherule

Writes both pictures of each scene, and prints the tables of docs/measurements/cycles.md. Converged pictures that already exist in
the output directory are used again. The particle file is y-up; both programs read the same z-up copy of it.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy
import OpenEXR
from PIL import Image

HERE = Path(__file__).resolve().parent

SIZE = [480, 270]
CAMERA = {"eye": [-2.6, -4.1, 2.6], "look_at": [0.1, 0.0, 1.2], "fov": 42.0}
RADIUS = 0.025
GROUND_EDGE = 60.0


def arguments():
    parser = argparse.ArgumentParser(description="spherule and Cycles")
    parser.add_argument("particles", type=Path, help="particles that pysplashsurf reads, y up")
    parser.add_argument("out", type=Path, help="directory for pictures and everything else")
    parser.add_argument("--spherule", default="spherule", help="the program")
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    parser.add_argument("--reference", type=int, default=512, help="samples of the converged pictures")
    parser.add_argument("--samples", type=int, nargs="+", default=[16, 64], help="samples of the noisy pictures")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each program per noisy picture")
    return parser.parse_args()


# Inputs for both programs


def write_environment(path):
    """A gradient with a soft warm key light on the left and a wide cool one on the right: an equirectangular image."""
    width, height = 512, 256
    longitude = (numpy.arange(width) + 0.5) / width * 2 * numpy.pi - numpy.pi
    latitude = numpy.pi / 2 - (numpy.arange(height) + 0.5) / height * numpy.pi
    longitude, latitude = numpy.meshgrid(longitude, latitude)
    right = numpy.cos(latitude) * numpy.sin(longitude)
    front = numpy.cos(latitude) * numpy.cos(longitude)
    up = numpy.sin(latitude)

    def lobe(direction, sharpness):
        direction = numpy.array(direction) / numpy.linalg.norm(direction)
        cosine = right * direction[0] + front * direction[1] + up * direction[2]
        return numpy.exp(sharpness * (cosine - 1.0))[..., None]

    height_part = (0.5 + 0.5 * up)[..., None]
    sky = (1 - height_part) * [0.20, 0.19, 0.18] + height_part * [0.20, 0.30, 0.50]
    key = lobe([-0.75, -0.35, 0.8], 120.0) * [60.0, 52.0, 42.0]
    fill = lobe([0.9, 0.1, 0.45], 8.0) * [0.35, 0.5, 0.8]
    pixels = (sky + key + fill).astype(numpy.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": pixels}).write(str(path))


def write_particles(source, path):
    """A copy with z up, and the height of the lowest particle."""
    text = path.with_suffix(".json")
    run(["pysplashsurf", "convert", "--particles", source, "-o", text, "--overwrite"])
    x, y, z = numpy.array(json.loads(text.read_text())).T
    numpy.save(path, numpy.stack([x, -z, y], axis=1).astype(numpy.float32))
    return float(y.min())


def write_mesh(source, path):
    """The surface of water, y up, with the settings of docs/measurements/surfaces.md."""
    run([
        "pysplashsurf", "reconstruct", source, f"-r={RADIUS}", "-l=2.0", "-c=0.5", "-t=0.6", "-o", path,
        "--mesh-cleanup=on", "--decimate-barnacles=on", "--mesh-smoothing-weights=on", "--mesh-smoothing-iters=25",
        "--normals=on", "--normals-smoothing-iters=10",
    ])  # fmt: skip


def write_ground(path, ground):
    edge, height = 0.5 * ground["size"], ground["height"]
    corners = [(-edge, -edge), (edge, -edge), (edge, edge), (-edge, edge)]
    lines = [f"v {x} {y} {height}" for x, y in corners] + ["f 1 2 3 4"]
    path.write_text("\n".join(lines) + "\n")


# In the terms of spherule's manifest
LIGHTS = [
    {"type": "rect", "position": [-2.5, -2.5, 3.0], "direction": [2.5, 2.5, -2.2], "width": 2.0, "height": 0.6,
     "color": [1.0, 0.8, 0.6], "intensity": 6.0},
    {"type": "disc", "position": [3.0, -1.0, 2.5], "direction": [-3.0, 1.0, -1.5], "radius": 0.6,
     "color": [0.5, 0.7, 1.0], "intensity": 8.0},
    {"type": "sphere", "position": [-2.0, 1.5, 1.0], "radius": 0.3, "color": [1.0, 0.4, 0.3], "intensity": 8.0},
    {"type": "point", "falloff": "inverse-square", "position": [1.8, -1.8, 0.5], "color": [0.3, 1.0, 0.4],
     "intensity": 0.5},
    {"type": "sun", "direction": [0.2, 0.6, -1.0], "size": 4.0, "color": [1.0, 1.0, 0.9], "intensity": 0.8},
]  # fmt: skip

SCENES = {
    # Matte spheres on a matte ground
    "spheres": {"material": "matte", "color": [0.30, 0.45, 0.65], "ground": 0.4, "intensity": 1.0, "bounces": 6},
    # Almost white, so that most of the light has been reflected often: do both programs count reflections alike?
    "bright": {"material": "matte", "color": [0.9, 0.9, 0.9], "ground": 0.9, "intensity": 0.4, "bounces": 3},
    # Microfacets
    "metal": {"material": "metal", "color": [0.95, 0.79, 0.55], "roughness": 0.4, "ground": 0.4, "intensity": 1.0,
              "bounces": 6},
    # A light of each kind: do units and sizes agree?
    "lights": {"material": "matte", "color": [0.8, 0.8, 0.8], "ground": 0.4, "intensity": 0.1, "bounces": 3,
               "lights": LIGHTS},
    # Clear water, from different surfaces
    "water": {"material": "water", "ior": 1.333, "ground": 0.4, "intensity": 1.0, "bounces": 6, "crossings": 16,
              "programs": ["spherule", "spherule-maps", "cycles"]},
    # Caustics of a sun so large that paths find it, too
    "caustics": {"material": "water", "ior": 1.333, "ground": 0.4, "intensity": 0.4, "bounces": 6, "crossings": 16,
                 "lights": [{**LIGHTS[-1], "size": 6.0, "intensity": 2.0}], "programs": ["spherule-maps", "cycles"]},
}  # fmt: skip


def scene_of(name, out, lowest):
    """What both programs need to know of a scene."""
    scene = {"size": SIZE, "radius": RADIUS, "crossings": 0, **CAMERA, **SCENES[name]}
    is_water = scene["material"] == "water"
    # Spheres touch the ground. The surface of water, about at the centres of its outer particles, cuts it
    height = lowest if is_water else lowest - RADIUS
    scene["ground"] = {"size": GROUND_EDGE, "height": height, "color": [scene["ground"]] * 3}
    scene["environment"] = str(out / "environment.exr")
    scene["particles"] = str(out / "particles.npy")
    if is_water:
        scene["mesh"] = str(out / "water.obj")
    return scene


# The programs


def run(command):
    """Runs a command. Returns its standard output, user CPU seconds and wall-clock seconds."""
    start = time.perf_counter()
    command = [str(part) for part in command]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"{' '.join(command)}\n{output}")
    return output, usage.ru_utime, time.perf_counter() - start


def spherule(options, scene, samples, image, seed=0):
    """The command of a scene. The ground is a mesh, because that of `render.ground` fades into the background."""
    ground = image.with_suffix(".obj")
    write_ground(ground, scene["ground"])
    settings = {
        "render.ground": "none",
        "mesh.0.color": scene["ground"]["color"],
        "mesh.0.normals": "flat",
    }
    return [*spherule_with(settings, options, scene, samples, image, seed), "--mesh", ground]


def spherule_maps(options, scene, samples, image, seed=0):
    """The same with the ground of spherule, on which paths below water end: maps have its light."""
    settings = {
        "render.ground": "plain",
        "render.ground_wetness": 0.0,
        "render.ground_color": scene["ground"]["color"],
        "render.ground_height": scene["ground"]["height"],
    }
    return spherule_with(settings, options, scene, samples, image, seed)


def spherule_with(ground, options, scene, samples, image, seed):
    settings = {
        **ground,
        "camera.eye": scene["eye"],
        "camera.look_at": scene["look_at"],
        "camera.fov": scene["fov"],
        "render.denoise": False,
        "environment.type": "image",
        "environment.image": scene["environment"],
        "environment.intensity": scene["intensity"],
        "environment.visible": True,
        "material.type": scene["material"],
    }
    if scene["material"] == "water":
        settings |= {
            "render.surface": "smooth",
            "render.max_depth": scene["crossings"],
            "material.ior": scene["ior"],
        }
    else:
        settings |= {"material.color": scene["color"], "material.roughness": scene.get("roughness", 0.55)}
    # spherule has no seed. Random numbers depend on the column, so a wider image has others at the same place
    (width, height), shift = scene["size"], seed
    command = [
        options.spherule, "still", scene["particles"], "-o", image, "--up", "z", "--radius", scene["radius"],
        "--channels", "RGBA", "--integrator", "path", "--bounces", scene["bounces"],
        "--samples", samples, "--width", width + 2 * shift, "--height", height,
        "--crop", f"{shift},0,{width + shift},{height}",
    ]  # fmt: skip
    if "lights" in scene:
        settings["light"] = "[" + ",".join(inline_table(light) for light in scene["lights"]) + "]"
    for key, value in settings.items():
        text = value if isinstance(value, str) else json.dumps(value)
        command += ["--set", f"{key}={text}"]
    return command


def inline_table(values):
    """A table of a manifest."""
    return "{" + ",".join(f"{key}={json.dumps(value)}" for key, value in values.items()) + "}"


def cycles(options, scene, samples, image, seed=0):
    """The command of a scene."""
    path = image.with_suffix(".json")
    path.write_text(json.dumps({**scene, "samples": samples, "seed": seed, "image": str(image)}))
    return [sys.executable, HERE / "cycles_scene.py", path]


# Pictures


def read_exr(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return numpy.stack([channels[c].pixels.astype(numpy.float64) for c in "RGB"], axis=-1)


def srgb_bytes(linear):
    """Bytes of sRGB, not rounded."""
    linear = numpy.clip(linear, 0.0, 1.0)
    return 255.0 * numpy.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def rmse(a, b):
    return float(numpy.sqrt(numpy.mean((srgb_bytes(a) - srgb_bytes(b)) ** 2)))


def write_png(linear, path):
    Image.fromarray(numpy.rint(srgb_bytes(linear)).astype(numpy.uint8)).save(path)


def compare_converged(a, b, out, name):
    """Prints how much two converged pictures differ, and writes them side by side with their difference."""
    print(f"{name}: mean relative difference {mean_relative_difference(a, b):.2f} %, of mean radiance "
          f"{100 * (a.mean() / b.mean() - 1):+.3f} %, RMSE {rmse(a, b):.2f} sRGB bytes")  # fmt: skip
    lower = slice(a.shape[0] // 2, None)
    print(f"    lower half, without the horizon: {mean_relative_difference(a[lower], b[lower]):.2f} %, "
          f"{100 * (a[lower].mean() / b[lower].mean() - 1):+.3f} %, RMSE {rmse(a[lower], b[lower]):.2f}")  # fmt: skip
    # Blocks of 8x8 pixels have an eighth of the noise
    print(f"    means of 8x8 pixels: {mean_relative_difference(blocks(a), blocks(b)):.2f} %", flush=True)
    shown = 0.5 + 5.0 * (srgb_bytes(a) - srgb_bytes(b)) / 255.0
    gray = numpy.rint(255 * numpy.clip(shown, 0, 1)).astype(numpy.uint8)
    Image.fromarray(gray).save(out / f"{name}-difference.png")
    write_png(numpy.concatenate([a, b], axis=1), out / f"{name}.png")


def mean_relative_difference(a, b):
    """The mean over pixels, in percent."""
    relative = numpy.abs(a - b).sum(axis=-1) / numpy.maximum(b.sum(axis=-1), 1e-6)
    return 100 * relative.mean()


def blocks(picture):
    """Means of 8x8 pixels; the rest is left out."""
    height, width = (size // 8 * 8 for size in picture.shape[:2])
    return picture[:height, :width].reshape(height // 8, 8, width // 8, 8, 3).mean(axis=(1, 3))


# Measurement


def main():
    options = arguments()
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    # pysplashsurf is next to this Python
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    write_environment(out / "environment.exr")
    lowest = write_particles(options.particles, out / "particles.npy")
    if "water" in options.scenes:
        write_mesh(options.particles, out / "water.obj")
    print("| scene | samples | RMSE spherule | RMSE Cycles | user CPU s spherule | Cycles | its render alone | "
          "Cycles / spherule at equal noise | its render alone |")  # fmt: skip
    for name in options.scenes:
        compare(name, scene_of(name, out, lowest), options, out)


PROGRAMS = {"spherule": spherule, "spherule-maps": spherule_maps, "cycles": cycles}


def compare(name, scene, options, out):
    # Only light below water is in maps
    programs = {program: PROGRAMS[program] for program in scene.get("programs", ["spherule", "cycles"])}
    converged = {}
    for program, command in programs.items():
        image = out / f"{name}-{program}-{options.reference}.exr"
        if not image.exists():
            _, user, wall = run(command(options, scene, options.reference, image, seed=1))
            print(f"{name}, {program}, {options.reference} samples: {user:.1f} s user, {wall:.1f} s", flush=True)
        converged[program] = read_exr(image)
    for program in programs:
        if program != "cycles":
            compare_converged(converged[program], converged["cycles"], out, f"{name}-{program}")
    for samples in options.samples:
        measure(name, scene, programs, samples, converged, options, out)


def measure(name, scene, programs, samples, converged, options, out):
    """Prints noise and time of `samples` per pixel. The programs take turns; the best time of each counts."""
    user, render, noise = {program: [] for program in programs}, [], {}
    for _ in range(options.repeats):
        for program, command in programs.items():
            image = out / f"{name}-{program}-{samples}.exr"
            output, seconds, _ = run(command(options, scene, samples, image))
            user[program].append(seconds)
            if program == "cycles":
                line = next(line for line in output.splitlines() if line.startswith('{"blender"'))
                render.append(json.loads(line)["render_user_s"])
            noise[program] = rmse(read_exr(image), converged[program])
    theirs, alone = min(user["cycles"]), min(render)
    for program in programs:
        if program == "cycles":
            continue
        ours = min(user[program])
        # The time that Cycles needs for the same noise: variance falls in proportion to time
        factor = (noise["cycles"] / noise[program]) ** 2 / ours
        print(f"| {name}, {program} | {samples} | {noise[program]:.2f} | {noise['cycles']:.2f} | {ours:.2f} | "
              f"{theirs:.2f} | {alone:.2f} | {factor * theirs:.1f} | {factor * alone:.1f} |")  # fmt: skip
    runs = {program: [round(seconds, 2) for seconds in all_runs] for program, all_runs in user.items()}
    print(f"    all runs: {runs}, render alone {[round(seconds, 2) for seconds in render]}", flush=True)


if __name__ == "__main__":
    main()
