"""Compares how much denoised sequences of spherule and Cycles flicker where the scene does not change.

    python docs/compare/flicker.py dam_break_frame_23_24389_particles.bgeo 'examples/dam-break/*.bgeo' out \\
        --spherule target/release/spherule

Three sequences of 24 pictures with new noise in each: `static` (the same picture), `turntable` (the camera goes around
the beads, 15 degrees per picture) and `splash` (the frames of the pattern forwards and backwards, as water). `out` is
the directory of equal_time.py, whose inputs and numbers of samples are used. Prints the table of
docs/measurements/cycles.md.
"""

import argparse
import glob
import json
import os
import re
import sys
from pathlib import Path

import equal_time
import numpy
import path_tracing
from path_tracing import read_exr, srgb_bytes

PICTURES = 24
DEGREES = 15.0
SPLASH = {"eye": [-2.1, -3.3, 1.9], "look_at": [0.0, 0.0, 0.35], "fov": 36.0}


def arguments():
    parser = argparse.ArgumentParser(description="flicker of spherule and Cycles")
    parser.add_argument("particles", type=Path, help="particles that pysplashsurf reads, y up")
    parser.add_argument("splash", help="pattern of the files of a sequence, in quotes")
    parser.add_argument("out", type=Path, help="directory of equal_time.py")
    parser.add_argument("--spherule", default="spherule", help="the program")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--sequences", nargs="+", default=["static", "turntable", "splash"])
    parser.add_argument("--same-samples", action="store_true", help="Cycles gets the samples of spherule, not its time")
    parser.add_argument("--one-seed", action="store_true", help="all pictures have the same random numbers")
    return parser.parse_args()


def splash_frames(options, out):
    """Particles, mesh and spray of each frame of the sequence, and the height of the lowest particle of all."""
    numbered = sorted(glob.glob(options.splash), key=lambda name: int(re.findall(r"\d+", Path(name).name)[-1]))
    frames, lowest = [], []
    for index, name in enumerate(numbered):
        folder = out / f"splash-{index}"
        folder.mkdir(exist_ok=True)
        if not (folder / "body.obj").exists():
            path_tracing.write_particles(name, folder / "particles.npy")
            equal_time.split_spray(numpy.load(folder / "particles.npy"), folder)
        lowest.append(float(numpy.load(folder / "particles.npy")[:, 2].min()))
        frames.append(folder)
    there_and_back = frames + frames[-2:0:-1]
    return [there_and_back[i % len(there_and_back)] for i in range(PICTURES)], min(lowest)


def scenes(sequence, options, out):
    """The scene of each picture of a sequence."""
    if sequence != "splash":
        scene = equal_time.scene_of("beads", "studio", options, out)
        for index in range(PICTURES):
            if sequence == "turntable":
                turn = numpy.radians(DEGREES * index)
                x, y = numpy.subtract(equal_time.DAM["eye"][:2], equal_time.DAM["look_at"][:2])
                x, y = x * numpy.cos(turn) - y * numpy.sin(turn), x * numpy.sin(turn) + y * numpy.cos(turn)
                eye = [x + scene["look_at"][0], y + scene["look_at"][1], scene["eye"][2]]
                yield {**scene, "eye": eye}
            else:
                yield scene
        return
    frames, lowest = splash_frames(options, out)
    for folder in frames:
        scene = equal_time.scene_of("water", "studio", options, out) | SPLASH
        scene |= {"particles": str(folder / "particles.npy"), "mesh": str(folder / "body.obj")}
        spray = folder / "spray.npy"
        if len(numpy.load(spray)):
            scene["spray"] = str(spray)
        else:
            del scene["spray"]
        scene["ground"]["height"] = lowest
        yield scene


def still_pixels(sequences):
    """Pixels of the ground whose mean of 5x5 pixels and of both programs changes by less than 5 bytes."""
    mean = numpy.mean(list(sequences.values()), axis=0)
    padded = numpy.pad(mean, ((0, 0), (2, 2), (2, 2), (0, 0)), mode="edge")
    height, width = mean.shape[1:3]
    smooth = sum(padded[:, y : y + height, x : x + width] for y in range(5) for x in range(5)) / 25
    still = (smooth.max(axis=0) - smooth.min(axis=0)).max(axis=-1) < 5.0
    # Not the background, and not a static body
    still[: int(0.25 * height)] = False
    grey = smooth.mean(axis=0)
    return still & (grey.max(axis=-1) - grey.min(axis=-1) < 20.0)


def main():
    options = arguments()
    out = options.out.resolve()
    # pysplashsurf is next to this Python
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    results = json.loads((out / "results.json").read_text())
    for sequence in options.sequences:
        samples = dict(results["water-studio" if sequence == "splash" else "beads-studio"]["samples"])
        if options.same_samples:
            samples["cycles"] = samples["spherule"]
        sequences_of, seconds = {}, {}
        for program in samples:
            pictures, seconds[program] = [], []
            for index, scene in enumerate(scenes(sequence, options, out)):
                seeds = "one-seed-" if options.one_seed else ""
                image = out / f"{sequence}-{program}-{samples[program]}-{seeds}{index:02}.exr"
                if not image.exists():
                    settings = {
                        **scene,
                        "samples": samples[program],
                        "denoise": True,
                        "seed": 1 if options.one_seed else 1 + index,
                    }
                    seconds[program].append(equal_time.render(program, options, settings, image))
                pictures.append(srgb_bytes(read_exr(image)))
            sequences_of[program] = numpy.array(pictures)
        still = still_pixels(sequences_of)
        for program, pictures in sequences_of.items():
            changes = numpy.abs(numpy.diff(pictures, axis=0)).mean(axis=-1)
            time = f"{numpy.mean(seconds[program]):.2f}" if seconds[program] else ""
            print(
                f"| {sequence} | {program} | {samples[program]} | {time} | {100 * still.mean():.0f} % | "
                f"{changes[:, still].mean():.2f} | "
                f"{numpy.percentile(changes[:, still], 99):.2f} | {changes.mean():.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
