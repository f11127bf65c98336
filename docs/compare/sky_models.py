"""Compares the sky of spherule with the sky texture of Cycles and with SPCTRAL2 at five elevations of the sun.

    pip install bpy numpy OpenEXR pillow
    python docs/compare/sky_models.py out --spherule target/release/spherule

Prints the table of docs/measurements/cycles.md and writes a contact sheet. SPCTRAL2 is that of pvlib, which needs a
newer numpy than bpy: `python docs/compare/sky_models.py out --spectral` in an environment with pvlib writes its values
to the output directory first.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy

ELEVATIONS = [60.0, 30.0, 10.0, 3.0, 0.5]
TURBIDITY = 2.5
ALBEDO = 0.2
SUN_SIZE = 0.545
# Azimuths of the sun: to the left and behind the sphere
SPHERULE_AZIMUTH, CYCLES_AZIMUTH = 225.0, 135.0
MODELS = {
    "spherule": None,
    "cycles": "MULTIPLE_SCATTERING",
    "cycles-single": "SINGLE_SCATTERING",
    "cycles-hosek-wilkie": "HOSEK_WILKIE",
}
XYZ_OF_RGB = numpy.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def arguments():
    parser = argparse.ArgumentParser(description="skies of spherule and Cycles")
    parser.add_argument("out", type=Path, help="directory for pictures and everything else")
    parser.add_argument("--spherule", default="spherule", help="the program")
    parser.add_argument("--spectral", action="store_true", help="only write the values of SPCTRAL2, with pvlib")
    parser.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


# Colour


def chromaticity(xyz):
    return xyz[:2] / xyz.sum()


def temperature(xyz):
    """Correlated colour temperature in K (Hernandez-Andres, Lee and Romero, 1999)."""
    x, y = chromaticity(xyz)
    n = (x - 0.3366) / (y - 0.1735)
    low = (
        -949.86315
        + 6253.80338 * numpy.exp(-n / 0.92159)
        + 28.70599 * numpy.exp(-n / 0.20039)
        + 0.00004 * numpy.exp(-n / 0.07125)
    )
    if low <= 50000:
        return low
    n = (x - 0.3356) / (y - 0.1691)
    return 36284.48953 + 0.00228 * numpy.exp(n / 0.07861) + 5.4535e-36 * numpy.exp(n / 0.01543)


def above_daylight(xyz):
    """How far y is above the locus of daylight of the CIE (Judd, MacAdam and Wyszecki, 1964)."""
    x, y = chromaticity(xyz)
    return y - (-3.0 * x**2 + 2.87 * x - 0.275)


def color_text(xyz):
    x, y = chromaticity(xyz)
    kelvin = temperature(xyz)
    text = f"{kelvin:.0f} K" if 1500 < kelvin < 25000 else "over 25 000 K" if kelvin > 25000 else "under 1500 K"
    return f"{x:.3f} {y:.3f} ({text}, {above_daylight(xyz):+.3f})"


# SPCTRAL2


def write_spectral(out):
    """Bird and Riordan, 1986, with the aerosols of a turbidity of 2.5 in Preetham and others, 1999."""
    import pvlib

    values = {}
    for elevation in ELEVATIONS:
        for turbidity in (TURBIDITY, 1.0):
            zenith = 90.0 - elevation
            beta = max(0.04608 * turbidity - 0.04586, 0.0)
            spectra = pvlib.spectrum.spectrl2(
                apparent_zenith=zenith,
                aoi=zenith,
                surface_tilt=0.0,
                ground_albedo=ALBEDO,
                surface_pressure=101325.0,
                relative_airmass=pvlib.atmosphere.get_relative_airmass(zenith, "kastenyoung1989"),
                ozone=0.35,
                precipitable_water=1.5,
                aerosol_turbidity_500nm=beta * 0.5**-1.3,
                dayofyear=80,
                alpha=1.3,
            )
            wavelengths = numpy.arange(380.0, 781.0, 5.0)
            sums = {}
            for name in ("dni", "dhi"):
                spectrum = numpy.interp(wavelengths, spectra["wavelength"], numpy.ravel(spectra[name]))
                sums[name] = (5.0 * spectrum[:, None] * observer(wavelengths)).sum(axis=0).tolist()
            name = "SPCTRAL2" if turbidity == TURBIDITY else "SPCTRAL2, no aerosols"
            values.setdefault(str(elevation), {})[name] = {"sun": sums["dni"], "sky": sums["dhi"]}
    (out / "spctral2.json").write_text(json.dumps(values))


def observer(wavelengths):
    """The CIE observer of 1931 (fit of Wyman, Sloan and Shirley, 2013)."""

    def lobe(peak, below, above):
        return numpy.exp(-0.5 * ((wavelengths - peak) / numpy.where(wavelengths < peak, below, above)) ** 2)

    x = 1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2)
    y = 0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1)
    z = 1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8)
    return numpy.stack([x, y, z], axis=1)


# Pictures


PANORAMA = {
    "size": [256, 128],
    "eye": [0.0, 0.0, 1.0],
    "look_at": [0.0, 1.0, 1.0],
    "fov": 45.0,
    "samples": 64,
    "sphere": [0.0, 0.0, 0.001, 0.001],
    "panorama": True,
}
PICTURE = {
    "size": [240, 135],
    "eye": [0.0, -4.2, 1.0],
    "look_at": [0.0, 0.0, 0.85],
    "fov": 38.0,
    "samples": 64,
    "sphere": [0.0, 0.0, 0.5, 0.5],
    "panorama": False,
}


def spherule(options, view, elevation, image):
    csv = image.with_suffix(".csv")
    csv.write_text("x,y,z,radius\n" + ",".join(map(str, view["sphere"])) + "\n")
    settings = {
        "camera.eye": view["eye"],
        "camera.look_at": view["look_at"],
        "image.filter": "box",
        "render.denoise": False,
        "environment.type": "sky",
        "environment.visible": True,
        "environment.turbidity": TURBIDITY,
        "environment.albedo": ALBEDO,
        "material.type": "matte",
        "material.color": [0.8] * 3,
        "render.ground": "plain",
        "render.ground_color": [ALBEDO] * 3,
        "render.ground_height": 0.0,
        "render.ground_wetness": 0.0,
        "environment.sun": f"{{elevation={elevation},azimuth={SPHERULE_AZIMUTH},size={SUN_SIZE}}}",
    }
    settings |= {"camera.projection": "equirectangular"} if view["panorama"] else {"camera.fov": view["fov"]}
    command = [
        options.spherule,
        "still",
        csv,
        "-o",
        image,
        "--up",
        "z",
        "--channels",
        "RGBA",
        "--samples",
        view["samples"],
        "--width",
        view["size"][0],
        "--height",
        view["size"][1],
        "--threads",
        options.threads,
    ]
    for key, value in settings.items():
        command += ["--set", f"{key}={value if isinstance(value, str) else json.dumps(value)}"]
    return command


def cycles(options, view, model, elevation, sun, image):
    from path_tracing import HERE

    numpy.save(image.with_suffix(".npy"), numpy.array([view["sphere"]], numpy.float32))
    scene = {
        **view,
        "threads": options.threads,
        "particles": str(image.with_suffix(".npy")),
        "radius": 1.0,
        "material": "matte",
        "color": [0.8] * 3,
        "bounces": 6,
        "crossings": 0,
        "image": str(image),
        "ground": {"size": 20000.0, "height": 0.0, "color": [ALBEDO] * 3},
        "sky": {
            "model": MODELS[model],
            "sun": sun,
            "size": SUN_SIZE,
            "elevation": elevation,
            "azimuth": CYCLES_AZIMUTH,
            "turbidity": TURBIDITY,
            "albedo": ALBEDO,
        },
    }
    path = image.with_suffix(".scene.json")
    path.write_text(json.dumps(scene))
    return [sys.executable, HERE / "cycles_scene.py", path]


def render(options, kind, model, elevation, out, sun=True):
    """The picture, which is rendered unless it exists."""
    from path_tracing import read_exr, run

    image = out / f"{kind}-{model}-{elevation}{'' if sun else '-no-sun'}.exr"
    if not image.exists():
        view = {"panorama": PANORAMA, "picture": PICTURE}[kind]
        if model == "spherule":
            run(spherule(options, view, elevation, image))
        else:
            run(cycles(options, view, model, elevation, sun, image))
    return read_exr(image)


# Measurement


def directions(shape):
    """Unit vectors of the pixels of a panorama whose centre is +y, and their solid angles."""
    height, width = shape[:2]
    latitude = numpy.pi / 2 - (numpy.arange(height) + 0.5) / height * numpy.pi
    longitude = (numpy.arange(width) + 0.5) / width * 2 * numpy.pi - numpy.pi
    lon, lat = numpy.meshgrid(longitude, latitude)
    vectors = numpy.stack([numpy.cos(lat) * numpy.sin(lon), numpy.cos(lat) * numpy.cos(lon), numpy.sin(lat)], axis=-1)
    return vectors, numpy.cos(lat) * (numpy.pi / height) * (2 * numpy.pi / width)


def measure(options, model, elevation, out):
    """XYZ: irradiance of sun (on a surface that faces it) and sky, radiance at the zenith and at the horizon."""
    has_sun = model != "cycles-hosek-wilkie"
    panorama = render(options, "panorama", model, elevation, out, sun=has_sun)
    vectors, solid_angles = directions(panorama.shape)
    below = vectors[..., 2] < -0.5
    weights = (solid_angles * below)[..., None]
    total = numpy.pi / ALBEDO * (panorama * weights).sum(axis=(0, 1)) / weights.sum()
    height, turn = numpy.radians(elevation), numpy.radians(CYCLES_AZIMUTH)
    sun = numpy.array([numpy.cos(height) * numpy.cos(turn), numpy.cos(height) * numpy.sin(turn), numpy.sin(height)])
    angle = numpy.degrees(numpy.arccos(numpy.clip(vectors @ sun, -1, 1)))
    up = vectors[..., 2]
    sky = panorama.copy()
    ring = (angle > 2.5) & (angle < 4.0) & (up > 0)
    sky[(angle <= 2.5) & (up > 0)] = sky[ring].mean(axis=0)
    light = (sky * (solid_angles * numpy.maximum(up, 0))[..., None]).sum(axis=(0, 1))
    if model != "spherule":
        # Without its disc, the sky alone lights the ground
        dark = render(options, "panorama", model, elevation, out, sun=False)
        integral, light = light, numpy.pi / ALBEDO * (dark * weights).sum(axis=(0, 1)) / weights.sum()
        print(f"    {model}, {elevation}: integral of the sky / its light {integral.sum() / light.sum():.3f}")
    away = vectors[..., :2] @ sun[:2] / numpy.cos(height)
    around = numpy.linalg.norm(vectors[..., :2], axis=-1)
    side = numpy.abs(away) < 0.5 * around  # at the sides of the sun
    opposite = away < -0.8 * around
    colors = {
        "sun": (total - light) / numpy.sin(height),
        "sky": light,
        "zenith": sky[up > 0.98].mean(axis=0),
        "horizon": sky[(up > 0.02) & (up < 0.12) & side].mean(axis=0),
        "opposite": sky[(up > 0.02) & (up < 0.12) & opposite].mean(axis=0),
    }
    brightest = numpy.unravel_index(panorama.sum(axis=-1).argmax(), up.shape)
    print(f"    {model}, {elevation}: brightest pixel {angle[brightest]:.1f} degrees from the sun")
    return {name: XYZ_OF_RGB @ rgb for name, rgb in colors.items()}


def main():
    options = arguments()
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    if options.spectral:
        write_spectral(out)
        return
    spectral = out / "spctral2.json"
    published = json.loads(spectral.read_text()) if spectral.exists() else {}
    lines, brightness = [], {}
    for elevation in ELEVATIONS:
        models = {model: measure(options, model, elevation, out) for model in MODELS}
        brightness[elevation] = {
            m: (v["sky"] + v["sun"] * numpy.sin(numpy.radians(elevation)))[1] for m, v in models.items()
        }
        for name, values in published.get(str(elevation), {}).items():
            models[name] = {part: numpy.array(xyz) for part, xyz in values.items()}
        for model, values in models.items():
            direct = values["sun"][1] * numpy.sin(numpy.radians(elevation))
            share = values["sky"][1] / (values["sky"][1] + direct)
            cells = [f"{elevation:g}", model, f"{share:.2f}"]
            for name in ("sun", "sky", "zenith", "horizon", "opposite"):
                # Too little light of the sun is a difference of two noisy numbers
                is_known = name in values and (name != "sun" or share < 0.985 or model.startswith("SPCTRAL2"))
                cells.append(color_text(values[name]) if is_known else "")
            cells.append(f"{values['horizon'][1] / values['zenith'][1]:.1f}" if "zenith" in values else "")
            lines.append("| " + " | ".join(cells) + " |")
    print(
        "| elevation | model | sky / all light on the ground | sun x y (K, dy) | "
        "sky on the ground | zenith | horizon beside the sun | opposite | horizon / zenith |"
    )
    print("\n".join(lines))
    for model in MODELS:
        print(
            model,
            "luminance on the ground:",
            {e: round(b[model] / brightness[60.0][model], 4) for e, b in brightness.items()},
        )
    write_sheet(options, brightness, out)


def write_sheet(options, brightness, out):
    """A row per model, whose exposure is that of spherule in each column."""
    from path_tracing import write_png
    from PIL import Image

    rows = []
    for model in ("spherule", "cycles"):
        row = []
        for elevation in ELEVATIONS:
            exposure = brightness[elevation]["spherule"] / brightness[elevation][model]
            row.append(exposure * render(options, "picture", model, elevation, out))
        rows.append(numpy.concatenate(row, axis=1))
    write_png(numpy.concatenate(rows, axis=0), out / "sky.png")
    Image.open(out / "sky.png").save(out / "sky.jpg", quality=85)


if __name__ == "__main__":
    main()
