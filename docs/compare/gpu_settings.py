"""Pictures of many settings on a GPU beside those of the CPU: pip install OpenEXR numpy

    python3 gpu_settings.py [PROGRAM [GPU [PARTICLES [SIZE]]]]

PROGRAM is `spherule` built with the feature `gpu`. Prints, for each combination, the mean of the differences of colours
or of a part of the light, whichever is larger, relative to the mean colour, and which other channels differ. Fails if one
differs by more than 1e-3, or coverage, ids or Cryptomatte at all. Compilers of drivers may fail in one variant of the kernels alone, so all are tried.
"""

import itertools
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR

PROGRAM, GPU, PARTICLES, SIZE = (sys.argv[1:] + ["spherule", "0", "5e3", "96x54"][len(sys.argv) - 1 :])[:4]
MATTES = 'output.channels=["RGBA", "Z", "N", "id", "cryptomatte"]'
DATA = 'output.channels=["RGBA", "Z", "N", "id"]'
LIGHT = 'output.channels=["RGBA", "Z", "N", "id", "lights", "direct", "light_groups", "shadow", "shadow_catcher"]'
KINDS = {"": DATA, ", Cryptomatte": MATTES, ", light by parts": LIGHT}
LIMIT = 1e-3
LENS = "depth of field"
BLUR = "motion blur"

# Each is on or off
FLAGS = [
    'material.type="metal"',
    "output.transparent=true",
    "material.opacity=0.5",
    "render.clamp=2",
]
OTHERS = {
    "plastic": ["--set", 'material.type="plastic"', "--set", "output.transparent=true"],
    "faint": ["--set", "material.opacity=0.05"],
    "plain ground": ["--ground", "plain"],
    "plain ground, transparent": ["--ground", "plain", "--set", "output.transparent=true"],
    "checker": ["--ground", "checker"],
    LENS: ["--set", "camera.aperture=0.05"],
    BLUR: ["--set", "camera.shutter=0.5", "--set", "output.frame_time=0.02"],
    "direct light": ["--set", "render.bounces=0"],
    "ambient light": ["--set", 'render.indirect="ambient"'],
    "colours": ["--color-by", "x"],
    "styles": ["--style", 'x > 5: spheres, radius 0.1, color gold, material { type = "metal", roughness = 0.3 }'],
    "lights": ["--set", 'light=[{ type = "sphere", position = [5, 5, 25], radius = 2, visible = true, group = "key" }]'],
    "whitted": ["--integrator", "whitted", "--ground", "none", "--look", "none"],
    "whitted, checker": ["--integrator", "whitted", "--ground", "checker", "--look", "none"],
    "whitted, plain ground, transparent": ["--integrator", "whitted", "--ground", "plain", "--set", "output.transparent=true"],
    f"{LENS}, whitted": ["--integrator", "whitted", "--ground", "plain", "--look", "none", "--set", "camera.aperture=0.05"],
    "glass": ["--set", 'material.type="glass"'],
    "glass, clamp, transparent": ["--set", 'material.type="glass"', "--set", "render.clamp=0.2", "--set", "output.transparent=true"],
    "rough glass": ["--set", 'material.type="glass"', "--set", "material.roughness=0.3"],
    "coloured glass": ["--set", 'material.type="glass"', "--set", 'material.absorption="color"', "--color-by", "x"],
    "whitted, glass": ["--integrator", "whitted", "--ground", "none", "--look", "none", "--set", "material.transmission=1"],
}


def combinations():
    """Names and options."""
    for number in range(2 ** len(FLAGS)):
        chosen = [flag for bit, flag in enumerate(FLAGS) if number >> bit & 1]
        yield ", ".join(chosen) or "default look", [word for flag in chosen for word in ("--set", flag)]
    yield from OTHERS.items()


def picture(file, device, options):
    """The channels of a still of a file."""
    path = str(file.with_name(f"{device}.exr"))
    still = [PROGRAM, "still", str(file), "-o", path, "--size", SIZE, "--samples", "4", "--device", device]
    chosen = ["--gpu", GPU] if device == "gpu" else []
    subprocess.run(still + chosen + ["--set", "render.denoise=false"] + options, check=True, capture_output=True)
    channels = OpenEXR.File(path, separate_channels=True).channels()
    return {name: channel.pixels for name, channel in channels.items()}


def main():
    """Compares all combinations, plain, with Cryptomatte and with light by parts."""
    worst, failed = 0.0, []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        box, water = folder / "box.npy", folder / "water.spf"
        for kind, file, others in (("box", box, []), ("block", water, ["--velocity"])):
            generate = [PROGRAM, "generate", kind, "--particles", PARTICLES, "-o", str(file), "-q"]
            subprocess.run(generate + others, check=True)
        for (title, options), (kind, channels) in itertools.product(combinations(), KINDS.items()):
            if channels is LIGHT and "whitted" in options:
                continue
            file = water if title == BLUR else box
            both = [picture(file, device, ["--set", channels] + options) for device in ("cpu", "gpu")]
            # Of the colours, and of each part of the light
            layers = {"RGB": ["R", "G", "B"], "shadow": ["shadow"]}
            for name in both[0]:
                layer, _, component = name.rpartition(".")
                if component in ("R", "G", "B") and layer and not layer.startswith("crypto"):
                    layers.setdefault(layer, []).append(name)
            size = max(np.mean([np.abs(both[0][name].astype("f8")).mean() for name in "RGB"]), 1e-9)
            difference = lambda name: np.abs(both[0][name].astype("f8") - both[1][name]).mean() if name in both[0] else 0
            error = max(np.mean([difference(name) for name in names]) for names in layers.values()) / size
            compared = sum(layers.values(), [])
            others = [name for name in both[0] if name not in compared]
            differ = [name for name in others if both[0][name].tobytes() != both[1][name].tobytes()]
            # The last bits of rays through a lens differ, so that some meet other particles
            exact = ("A",) if title.startswith(LENS) else ("A", "id", "crypto")
            important = [name for name in differ if name.startswith(exact)]
            row = title + kind
            print(f"{row:90} {error:.1e}  {' '.join(differ)}", flush=True)
            worst = max(worst, error)
            if not error <= LIMIT or important:
                failed.append(row)
    print(f"largest difference of colours {worst:.1e}; failed: {failed or 'none'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
