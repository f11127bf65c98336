"""Noise of spherule and Cycles at equal CPU time: five scenes, three environments, with and without denoisers.

    pip install bpy pysplashsurf numpy OpenEXR pillow
    python docs/compare/equal_time.py dam_break_frame_23_24389_particles.bgeo out --spherule target/release/spherule

Renders what is not in the output directory yet, and prints the tables of docs/measurements/cycles.md from it.
`--reference 8` renders 8 converged pictures of 512 samples with different random numbers, which are averaged. The
particle file is y-up; both programs read the same z-up copy of it.
"""

import argparse
import json
import os
import sys
from pathlib import Path

import numpy
import path_tracing
from PIL import Image
from path_tracing import RADIUS, inline_table, read_exr, run, srgb_bytes

SIZE = [192, 108]
PART = 512  # samples of a part of a converged picture
DAM = {"eye": [-2.6, -4.1, 2.4], "look_at": [0.15, 0.0, 0.85], "fov": 34.0}
# spherule draws spray, particles with fewer neighbours than 6 within 4 radii, as white spheres of half the radius
SPRAY = {"neighbours": 6, "support": 4.0 * RADIUS, "radius": 0.5 * RADIUS, "color": 0.9}

SCENES = {
    "beads": {"material": "matte", "color": [0.30, 0.45, 0.65], "bounces": 6, **DAM},
    "metal": {"material": "metal", "color": [0.95, 0.79, 0.55], "roughness": 0.3, "bounces": 6, **DAM},
    "glass": {
        "material": "glass",
        "ior": 1.5,
        "bounces": 6,
        "crossings": 16,
        "eye": [0.0, -5.2, 2.3],
        "look_at": [0.0, 0.0, 0.25],
        "fov": 26.0,
    },
    "water": {"material": "water", "ior": 1.333, "bounces": 6, "crossings": 16, **DAM},
    "cornell": {
        "material": "matte",
        "color": [0.8, 0.8, 0.8],
        "bounces": 6,
        "size": [144, 144],
        "eye": [0.0, -4.6, 1.0],
        "look_at": [0.0, 0.0, 1.0],
        "fov": 31.0,
    },
}
ENVIRONMENTS = {
    "studio": {"intensity": 1.0},
    "outdoor": {"intensity": 1.0},
    "constant": {"intensity": 0.7},
}
GROUND = 0.4


def arguments():
    parser = argparse.ArgumentParser(description="spherule and Cycles at equal CPU time")
    parser.add_argument("particles", type=Path, help="particles that pysplashsurf reads, y up")
    parser.add_argument("out", type=Path, help="directory for pictures and everything else")
    parser.add_argument("--spherule", default="spherule", help="the program")
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    parser.add_argument("--environments", nargs="+", default=list(ENVIRONMENTS), choices=ENVIRONMENTS)
    parser.add_argument("--samples", type=int, default=64, help="samples of spherule")
    parser.add_argument("--repeats", type=int, default=2, help="runs of each program per noisy picture")
    parser.add_argument("--reference", type=int, default=8, help=f"parts of converged pictures, {PART} samples each")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--tables", action="store_true", help="only print the tables and write the contact sheet")
    return parser.parse_args()


# Inputs for both programs


def write_outdoor(path):
    """A sky with a sun of 1.5 degrees at 40 degrees, whose irradiance is 2.5: an equirectangular image."""
    width, height = 1024, 512
    fine = 4  # subpixels along an edge
    pixels = numpy.empty((height, width, 3), numpy.float32)
    longitude = (numpy.arange(width * fine) + 0.5) / (width * fine) * 2 * numpy.pi - numpy.pi
    elevation, azimuth, size = numpy.radians([40.0, 50.0, 1.5])
    sun = [numpy.cos(elevation) * numpy.sin(azimuth), -numpy.cos(elevation) * numpy.cos(azimuth), numpy.sin(elevation)]
    radiance = numpy.array([2.7, 2.5, 2.2]) / (numpy.pi * numpy.sin(0.5 * size) ** 2)
    for row in range(height):
        latitude = numpy.pi / 2 - (row * fine + numpy.arange(fine) + 0.5) / (height * fine) * numpy.pi
        lon, lat = numpy.meshgrid(longitude, latitude)
        # The centre of the image is what a camera at -y sees, +y
        cosine = numpy.cos(lat) * (numpy.sin(lon) * sun[0] + numpy.cos(lon) * sun[1]) + numpy.sin(lat) * sun[2]
        up = numpy.sin(lat)[..., None]
        sky = numpy.where(
            up > 0, [0.50, 0.55, 0.62] + numpy.clip(up, 0, 1) ** 0.5 * [-0.38, -0.32, -0.15], [0.20, 0.18, 0.16]
        )
        sky = sky + numpy.exp(30.0 * (cosine - 1.0))[..., None] * [0.9, 0.8, 0.6] * (up > 0)
        sky = sky + (cosine > numpy.cos(0.5 * size))[..., None] * radiance
        pixels[row] = sky.reshape(fine, width, fine, 3).mean(axis=(0, 2))
    header = {"compression": path_tracing.OpenEXR.ZIP_COMPRESSION, "type": path_tracing.OpenEXR.scanlineimage}
    path_tracing.OpenEXR.File(header, {"RGB": pixels}).write(str(path))


def split_spray(particles, out):
    """The particles of the body and those of spray, by the rule of spherule."""
    support = SPRAY["support"]
    bins = {}
    for index, cell in enumerate(map(tuple, numpy.floor(particles / support).astype(int))):
        bins.setdefault(cell, []).append(index)
    is_spray = numpy.zeros(len(particles), bool)
    steps = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]
    for cell, members in bins.items():
        near = numpy.concatenate([bins.get(tuple(numpy.add(cell, step)), []) for step in steps]).astype(int)
        for index in members:
            distances = numpy.linalg.norm(particles[near] - particles[index], axis=1)
            is_spray[index] = numpy.count_nonzero(distances <= support) - 1 < SPRAY["neighbours"]
    numpy.save(out / "spray.npy", particles[is_spray])
    body = particles[~is_spray]
    # The mesh is y-up, as in path_tracing.py
    positions = numpy.stack([body[:, 0], body[:, 2], -body[:, 1]], axis=1)
    (out / "body.json").write_text(json.dumps(positions.tolist()))
    path_tracing.write_mesh(out / "body.json", out / "body.obj")


def write_balls(path):
    """Balls of glass on the ground: x, y, z and radius."""
    random = numpy.random.default_rng(7)
    balls = []
    while len(balls) < 60:
        radius = 0.09 + 0.24 * random.random() ** 3
        x, y = random.uniform(-1.6, 1.6), random.uniform(-1.4, 1.4)
        if all(numpy.hypot(x - b[0], y - b[1]) > radius + b[3] + 0.01 for b in balls):
            balls.append((x, y, radius, radius))
    write_spheres(path, balls)


def write_beads(path):
    """A pyramid of balls in the Cornell box."""
    radius = 0.11
    beads = []
    for layer in range(4):
        edge = 4 - layer
        for i in range(edge):
            for j in range(edge):
                x, y = (2 * i - edge + 1) * radius + 0.38, (2 * j - edge + 1) * radius - 0.35
                beads.append((x, y, radius + layer * radius * 2**0.5, radius))
    write_spheres(path, beads)


def write_spheres(path, spheres):
    numpy.save(path.with_suffix(".npy"), numpy.array(spheres, numpy.float32))
    rows = [",".join(f"{value:.7g}" for value in sphere) for sphere in spheres]
    path.with_suffix(".csv").write_text("x,y,z,radius\n" + "\n".join(rows) + "\n")


def write_cornell(out):
    """The walls and a box of the Cornell box, which is open towards the camera, as meshes of both programs."""

    def quads(name, faces):
        corners = [corner for face in faces for corner in face]
        lines = ["v {} {} {}".format(*corner) for corner in corners]
        lines += ["f {} {} {} {}".format(*range(4 * i + 1, 4 * i + 5)) for i in range(len(faces))]
        path = out / f"cornell-{name}.obj"
        path.write_text("\n".join(lines) + "\n")
        return str(path)

    floor = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    ceiling = [(x, y, 2) for x, y, _ in floor]
    back = [(-1, 1, 0), (1, 1, 0), (1, 1, 2), (-1, 1, 2)]
    left = [(-1, -1, 0), (-1, 1, 0), (-1, 1, 2), (-1, -1, 2)]
    right = [(1, y, z) for _, y, z in left]
    turn = numpy.radians(20.0)
    base = [
        (
            -0.4 + 0.3 * (x * numpy.cos(turn) - y * numpy.sin(turn)),
            0.3 + 0.3 * (x * numpy.sin(turn) + y * numpy.cos(turn)),
        )
        for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    sides = [[(*base[i], 0), (*base[(i + 1) % 4], 0), (*base[(i + 1) % 4], 1.2), (*base[i], 1.2)] for i in range(4)]
    box = [*sides, [(*corner, 1.2) for corner in base]]
    return [
        {"path": quads("white", [floor, ceiling, back]), "color": [0.73, 0.73, 0.73], "normals": "flat"},
        {"path": quads("red", [left]), "color": [0.65, 0.05, 0.05], "normals": "flat"},
        {"path": quads("green", [right]), "color": [0.12, 0.45, 0.15], "normals": "flat"},
        {"path": quads("box", box), "color": [0.73, 0.73, 0.73], "normals": "flat"},
    ]


LAMP = {
    "type": "rect",
    "position": [0.0, 0.0, 1.99],
    "direction": [0.0, 0.0, -1.0],
    "width": 0.6,
    "height": 0.6,
    "color": [1.0, 0.85, 0.65],
    "intensity": 7.0,
    "visible": True,
}


def write_inputs(options, out):
    path_tracing.write_environment(out / "studio.exr")
    write_outdoor(out / "outdoor.exr")
    lowest = path_tracing.write_particles(options.particles, out / "particles.npy")
    split_spray(numpy.load(out / "particles.npy"), out)
    write_balls(out / "balls")
    write_beads(out / "beads")
    (out / "inputs.json").write_text(json.dumps({"lowest": lowest, "cornell": write_cornell(out)}))


def scene_of(name, environment, options, out):
    """What both programs need to know of a scene."""
    inputs = json.loads((out / "inputs.json").read_text())
    light = ENVIRONMENTS[environment]
    scene = {"size": SIZE, "radius": RADIUS, "crossings": 0, "threads": options.threads, **SCENES[name], **light}
    scene["environment"] = [1.0] * 3 if environment == "constant" else str(out / f"{environment}.exr")
    scene["particles"] = str(out / "particles.npy")
    if name == "cornell":
        scene |= {"particles": str(out / "beads.npy"), "meshes": inputs["cornell"], "lights": [LAMP]}
        scene["intensity"] *= 0.3
        return scene
    height = {"glass": 0.0, "water": inputs["lowest"]}.get(name, inputs["lowest"] - RADIUS)
    scene["ground"] = {"size": 4000.0, "height": height, "color": [GROUND] * 3}
    if name == "glass":
        scene["particles"] = str(out / "balls.npy")
    if name == "water":
        scene |= {
            "mesh": str(out / "body.obj"),
            "spray": str(out / "spray.npy"),
            "spray_radius": SPRAY["radius"],
            "spray_color": SPRAY["color"],
        }
    return scene


# The programs


def spherule(options, scene, image):
    settings = {
        "camera.eye": scene["eye"],
        "camera.look_at": scene["look_at"],
        "camera.fov": scene["fov"],
        "image.filter": "box",
        "render.denoise": scene["denoise"],
        "environment.intensity": scene["intensity"],
        "environment.visible": True,
        "material.type": scene["material"],
        "render.ground": "none",
    }
    if isinstance(scene["environment"], str):
        settings |= {"environment.type": "image", "environment.image": scene["environment"]}
    else:
        settings |= {"environment.type": "constant"}
    if "ground" in scene:
        settings |= {
            "render.ground": "plain",
            "render.ground_wetness": 0.0,
            "render.ground_color": scene["ground"]["color"],
            "render.ground_height": scene["ground"]["height"],
        }
    if "ior" in scene:
        settings |= {"render.max_depth": scene["crossings"], "material.ior": scene["ior"], "material.fresnel": "exact"}
    else:
        settings |= {"material.color": scene["color"]}
    if "roughness" in scene:
        settings |= {"material.roughness": scene["roughness"]}
    if scene["material"] == "water":
        settings |= {"render.surface": "smooth", "surface.spray": True, "surface.spray_style": "spheres"}
    for key, table in (("light", "lights"), ("mesh", "meshes")):
        if table in scene:
            settings[key] = "[" + ",".join(inline_table(values) for values in scene[table]) + "]"
    particles, radius = scene["particles"], ["--radius", scene["radius"]]
    if Path(particles).with_suffix(".csv").exists():
        particles, radius = str(Path(particles).with_suffix(".csv")), []
    width, height = scene["size"]
    command = [
        options.spherule,
        "still",
        particles,
        "-o",
        image,
        "--up",
        "z",
        *radius,
        "--channels",
        "RGBA",
        "--integrator",
        "path",
        "--bounces",
        scene["bounces"],
        "--samples",
        scene["samples"],
        "--seed",
        scene["seed"],
        "--width",
        width,
        "--height",
        height,
        "--threads",
        options.threads,
    ]
    for key, value in settings.items():
        command += ["--set", f"{key}={value if isinstance(value, str) else json.dumps(value)}"]
    return command


def cycles(options, scene, image):
    path = image.with_suffix(".scene.json")
    path.write_text(json.dumps({**scene, "image": str(image)}))
    return [sys.executable, path_tracing.HERE / "cycles_scene.py", path]


def render(program, options, scene, image):
    """Renders a picture. Returns user CPU seconds: of the process, or for Cycles of the render alone."""
    output, seconds, _ = run({"spherule": spherule, "cycles": cycles}[program](options, scene, image))
    if program == "cycles":
        line = next(line for line in output.splitlines() if line.startswith('{"blender"'))
        seconds = json.loads(line)["render_user_s"]
    return seconds


# Measurement


def measure(name, environment, options, out):
    """Renders noisy pictures at equal time, and the denoised ones. Returns times and samples."""
    scene = scene_of(name, environment, options, out)
    stem = f"{name}-{environment}"
    ours = {**scene, "samples": options.samples, "denoise": False}
    # The number of samples for which Cycles needs the time of spherule
    first = render("spherule", options, {**ours, "seed": 1}, out / f"{stem}-spherule-1.exr")
    probes = []
    for samples in (8, 40):
        seconds = render("cycles", options, {**ours, "samples": samples, "seed": 1}, out / f"{stem}-probe.exr")
        probes.append(seconds)
    slope = max((probes[1] - probes[0]) / 32, 1e-4)
    samples = max(2, round(8 + (first - probes[0]) / slope))
    result = {"samples": {"spherule": options.samples, "cycles": samples}, "seconds": {}, "denoised_seconds": {}}
    for denoise in (False, True):
        seconds = {"spherule": [], "cycles": []}
        for seed in range(1, options.repeats + 1):
            for program in seconds:
                kind = "denoised" if denoise else "noisy"
                image = out / f"{stem}-{program}-{kind}-{seed}.exr"
                settings = {**scene, "samples": result["samples"][program], "denoise": denoise, "seed": seed}
                seconds[program].append(round(render(program, options, settings, image), 3))
        result["denoised_seconds" if denoise else "seconds"] = seconds
    print(stem, json.dumps(result), flush=True)
    return result


def reference_parts(name, environment, program, out):
    return sorted(out.glob(f"{name}-{environment}-{program}-reference-*.exr"))


def reference_seconds(name, environment, program, out):
    """The least time of a part of a converged picture."""
    seconds = json.loads((out / "reference-seconds.json").read_text())
    stem = f"{name}-{environment}-{program}-reference-"
    return min(value for key, value in seconds.items() if key.startswith(stem))


def errors(picture, reference):
    """Root mean square error in bytes of sRGB, and relative mean square error of linear RGB."""
    rmse = numpy.sqrt(numpy.mean((srgb_bytes(picture) - srgb_bytes(reference)) ** 2))
    return float(rmse), float(numpy.mean((picture - reference) ** 2 / (reference**2 + 0.01)))


def table_row(name, environment, result, options, out):
    references, pictures, row = {}, {}, {}
    for program in ("spherule", "cycles"):
        paths = reference_parts(name, environment, program, out)
        if not paths:
            return None
        parts = [read_exr(path) for path in paths]
        references[program] = numpy.mean(parts, axis=0)
        row[f"{program} reference"] = PART * len(parts)
        for kind in ("noisy", "denoised"):
            images = sorted(out.glob(f"{name}-{environment}-{program}-{kind}-*.exr"))
            pictures[program, kind] = [read_exr(image) for image in images]
            values = [errors(picture, references[program]) for picture in pictures[program, kind]]
            row[program, kind] = numpy.mean(values, axis=0)
            times = result["seconds" if kind == "noisy" else "denoised_seconds"][program]
            row[program, kind, "seconds"] = min(times)
        # The errors contain the noise of the reference, in proportion to their samples
        share = result["samples"][program] / row[f"{program} reference"]
        noise = row[program, "noisy"] * [(1 + share) ** -0.5, 1 / (1 + share)]
        error, relative = row[program, "denoised"]
        row[program, "noisy"] = noise
        left = max(error**2 - share * noise[0] ** 2, 0.0), max(relative - share * noise[1], 0.0)
        row[program, "denoised"] = left[0] ** 0.5, left[1]
    ours, theirs = references["spherule"], references["cycles"]
    # Cycles adds what is behind a lamp to its light
    rest = (ours.max(axis=-1) < 1.5) | (name != "cornell")
    row["means"] = ours[rest].mean(), theirs[rest].mean()
    row["blocks"] = path_tracing.mean_relative_difference(path_tracing.blocks(ours), path_tracing.blocks(theirs))
    seconds = [row[program, "noisy", "seconds"] for program in ("spherule", "cycles")]
    variances = [row[program, "noisy"][0] ** 2 for program in ("spherule", "cycles")]
    row["ratio"] = variances[1] * seconds[1] / (variances[0] * seconds[0])
    # The same for many samples, without the costs that do not depend on them: variance falls in proportion to samples
    spent = [reference_seconds(name, environment, program, out) for program in ("spherule", "cycles")]
    products = [v * result["samples"][p] * t for v, p, t in zip(variances, ("spherule", "cycles"), spent)]
    row["ratio of many"] = products[1] / products[0]
    row["spent"] = spent
    relative = [row[program, "noisy"][1] for program in ("spherule", "cycles")]
    row["relative ratio"] = relative[1] * seconds[1] / (relative[0] * seconds[0])
    row["shown"] = [pictures[p, k][0] for k in ("noisy", "denoised") for p in ("spherule", "cycles")]
    row["references"] = ours, theirs
    return row


def print_tables(options, out):
    results = json.loads((out / "results.json").read_text())
    rows = {}
    known = [f"{name}-{environment}" for name in SCENES for environment in ENVIRONMENTS]
    for key, result in [(key, results[key]) for key in known if key in results]:
        name, environment = key.split("-")
        row = table_row(name, environment, result, options, out)
        if row:
            rows[key] = row
    print("| scene | environment | reference samples | mean radiance spherule | Cycles | difference | 8x8 pixels |")
    for key, row in rows.items():
        ours, theirs = row["means"]
        print(
            f"| {key.replace('-', ' | ')} | {row['spherule reference']}, {row['cycles reference']} | {ours:.4f} | "
            f"{theirs:.4f} | {100 * (ours / theirs - 1):+.2f} % | {row['blocks']:.2f} % |"
        )
    print(
        "| scene | environment | samples | CPU s | RMSE spherule | Cycles | relative MSE spherule | Cycles | "
        "ratio | ratio of relative MSE | CPU s of 512 samples | ratio |"
    )
    for key, row in rows.items():
        samples = results[key]["samples"]
        a, b = row["spherule", "noisy"], row["cycles", "noisy"]
        print(
            f"| {key.replace('-', ' | ')} | {samples['spherule']}, {samples['cycles']} | "
            f"{row['spherule', 'noisy', 'seconds']:.2f}, {row['cycles', 'noisy', 'seconds']:.2f} | {a[0]:.2f} | "
            f"{b[0]:.2f} | {a[1]:.2g} | {b[1]:.2g} | {row['ratio']:.1f} | {row['relative ratio']:.1f} | "
            f"{row['spent'][0]:.1f}, {row['spent'][1]:.1f} | {row['ratio of many']:.1f} |"
        )
    print(
        "| scene | environment | CPU s | RMSE spherule | Cycles | relative MSE spherule | Cycles | "
        "RMSE spherule / Cycles |"
    )
    for key, row in rows.items():
        a, b = row["spherule", "denoised"], row["cycles", "denoised"]
        print(
            f"| {key.replace('-', ' | ')} | {row['spherule', 'denoised', 'seconds']:.2f}, "
            f"{row['cycles', 'denoised', 'seconds']:.2f} | {a[0]:.2f} | {b[0]:.2f} | {a[1]:.2g} | {b[1]:.2g} | "
            f"{a[0] / b[0]:.2f} |"
        )
    if rows:
        write_sheet(rows, out)


def write_sheet(rows, out):
    """A row per scene: in each environment the denoised picture of spherule and that of Cycles."""
    names = list(dict.fromkeys(key.split("-")[0] for key in rows))
    lines = []
    for name in names:
        cells = []
        for environment in ENVIRONMENTS:
            row = rows.get(f"{name}-{environment}")
            height = SCENES[name].get("size", SIZE)[1]
            for picture in row["shown"][2:] if row else []:
                cell = numpy.ones((height, SIZE[0], 3))
                cell[:, : picture.shape[1]] = picture
                cells.append(cell)
        lines.append(numpy.concatenate(cells, axis=1))
    width = max(line.shape[1] for line in lines)
    lines = [numpy.pad(line, ((0, 0), (0, width - line.shape[1]), (0, 0)), constant_values=1.0) for line in lines]
    path_tracing.write_png(numpy.concatenate(lines, axis=0), out / "sheet.png")
    for key, row in rows.items():
        picture = numpy.concatenate(
            [
                numpy.concatenate(row["shown"][:2], axis=1),
                numpy.concatenate(row["shown"][2:], axis=1),
                numpy.concatenate(row["references"], axis=1),
            ],
            axis=0,
        )
        path_tracing.write_png(picture, out / f"{key}.png")
    Image.open(out / "sheet.png").save(out / "sheet.jpg", quality=85)


def main():
    options = arguments()
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    # pysplashsurf is next to this Python
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    results, reference_times = out / "results.json", out / "reference-seconds.json"
    if not options.tables:
        if not (out / "inputs.json").exists():
            write_inputs(options, out)
        pairs = [(name, environment) for name in options.scenes for environment in options.environments]
        known = json.loads(results.read_text()) if results.exists() else {}
        for name, environment in pairs:
            if f"{name}-{environment}" not in known:
                known[f"{name}-{environment}"] = measure(name, environment, options, out)
                results.write_text(json.dumps(known, indent=1))
        for part in range(options.reference):
            for name, environment in pairs:
                scene = {
                    **scene_of(name, environment, options, out),
                    "samples": PART,
                    "denoise": False,
                    "seed": 100 + part,
                }
                for program in ("spherule", "cycles"):
                    image = out / f"{name}-{environment}-{program}-reference-{part}.exr"
                    if not image.exists():
                        seconds = render(program, options, scene, image)
                        spent = json.loads(reference_times.read_text()) if reference_times.exists() else {}
                        reference_times.write_text(json.dumps({**spent, image.name: seconds}, indent=1))
                        print(f"{image.name}: {seconds:.1f} s", flush=True)
    print_tables(options, out)


if __name__ == "__main__":
    main()
