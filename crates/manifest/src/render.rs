//! `[image]` and `[render]`: the size of images, and the settings of tracing.

use glam::Vec3;
use spherule_files::Bytes;
use spherule_images::overlay::Layout;
use spherule_tracer::render::{
    DEFAULT_BOUNCES, DEFAULT_MIN_WEIGHT, DataWindow, FilterKind, IntegratorKind, MAX_BOUNCES,
    MAX_CLAMP, MAX_DEPTH, MAX_FILTER_WIDTH, MAX_NOISE, MAX_SAMPLES, MAX_SEED, MAX_SIDE,
    MIN_WEIGHTS, RendererKind,
};
use spherule_tracer::scene::{Background, ground};
use spherule_tree::accel::{BvhLeaves, BvhPreset, SbvhSettings, Structure};

use super::caustics::Caustics;
use super::crop::PixelBounds;
use super::ground::GroundSetting;
use super::key::Affects;
use super::keys::{Keys, section};
use super::print_size::{DEFAULT_DPI, Side, wrong_size};
use super::reader::Section;
use super::value::{Named, named};

/// Maximum number of pixels to add on each side of an image.
const MAX_OVERSCAN: u32 = 8192;

/// Maximum number of pixels per inch.
const MAX_DPI: u32 = 4800;

section! {
    /// Size and sampling of the image
    Image {
        /// Image width in pixels, or on paper, such as "85mm"
        ///
        /// Units are mm, cm, in and pt; dpi gives the number of pixels. If only one side is a length on paper and the
        /// other one is not given, the image is 16:9.
        width: Side = Side::Pixels(1920), from(1), to(MAX_SIDE), flag("width", "WIDTH", "Image");
        /// Image height in pixels, or on paper, such as "60mm"
        height: Side = Side::Pixels(1080), from(1), to(MAX_SIDE), flag("height", "HEIGHT", "Image");
        /// Pixels per inch on paper, stored in the images
        dpi: Option<u32> = None, from(1), to(MAX_DPI), example("300"),
            unset("not stored; 300 if a side is a length on paper"), flag("dpi", "DPI", "Image");
        /// Samples per pixel
        samples: u32 = 16, from(1), to(MAX_SAMPLES), flag("samples", "SAMPLES", "Image");
        /// Maximum number of samples per pixel, where render.noise limits noise
        max_samples: Option<u32> = None, from(1), to(MAX_SAMPLES), example("256"),
            unset("1024, or image.samples if that is more"), affects(Affects::NoiseLimit);
        /// Pixel filter: box | gaussian | blackman-harris
        ///
        /// The samples of a pixel are distributed like the filter and have equal weights. A single sample is at the
        /// centre of the pixel.
        filter: FilterKind = FilterKind::BlackmanHarris;
        /// Width of the pixel filter in pixels
        filter_width: Option<f32> = None, above(0), to(MAX_FILTER_WIDTH), unit("a number of pixels"),
            example("2.0"), unset("1 for box, 2 for gaussian, 3 for blackman-harris");
        /// Part of the image to render: [x0, y0, x1, y1] in pixels, from the top left, without column x1 and row y1
        ///
        /// Its pixels are those of the whole image. With denoising, they may differ near its border, where the denoiser
        /// lacks the neighbours; with render.noise, everywhere, because tiles begin at the corner of the part. The part is
        /// the data window of the EXR; previews show only the part.
        crop: Option<PixelBounds> = None, example("[0, 0, 960, 540]"), unset("the whole image"),
            flag("crop", "X0,Y0,X1,Y1", "Image");
        /// Pixels to add on each side of the image; they extend the data window of the EXR
        overscan: u32 = 0, from(0), to(MAX_OVERSCAN), unit("pixels");
        /// Place of overlays without a layout of their own: over | beside the picture
        ///
        /// Beside, the picture is smaller than the image and leaves room for them in previews and stills. OpenEXR images
        /// then have the size of the picture alone.
        layout: Layout = Layout::Over, flag("layout", "LAYOUT", "Image");
    }
}

impl Image {
    /// All keys. Lengths on paper become pixels.
    pub(super) fn all_keys(&mut self, keys: &mut Keys<'_>) {
        self.keys(keys);
        let Some(section) = keys.reading() else {
            return;
        };
        if ![self.width, self.height].into_iter().any(Side::is_on_paper) {
            return;
        }
        let dpi = *self.dpi.get_or_insert(DEFAULT_DPI);
        match [section.lacks("width"), section.lacks("height")] {
            [false, true] => self.height = Side::Pixels((self.width.pixels(dpi) * 9).div_ceil(16)),
            [true, false] => self.width = Side::Pixels((self.height.pixels(dpi) * 16).div_ceil(9)),
            _ => {}
        }
        for (key, side) in [("width", &mut self.width), ("height", &mut self.height)] {
            let pixels = side.pixels(dpi);
            if let Some(what) = wrong_size(pixels, dpi) {
                section.wrong(key, &what);
            }
            *side = Side::Pixels(pixels);
        }
    }

    /// The picture that consists of so many of these images beside each other and below each other.
    pub fn of_eyes(&self, eyes: [u32; 2]) -> Self {
        let [width, height] = self.size();
        Self {
            width: Side::Pixels(width.saturating_mul(eyes[0])),
            height: Side::Pixels(height.saturating_mul(eyes[1])),
            ..self.clone()
        }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        let dpi = self.dpi.unwrap_or(DEFAULT_DPI);
        [self.width.pixels(dpi), self.height.pixels(dpi)]
    }

    /// The rendered pixels: columns and rows of the image from `[x0, y0]` up to, but without, `[x1, y1]`.
    fn data_bounds(&self) -> [i64; 4] {
        match self.crop {
            Some(PixelBounds(bounds)) => bounds.map(i64::from),
            None => self.largest_bounds(),
        }
    }

    /// All pixels of the image, with its overscan.
    fn largest_bounds(&self) -> [i64; 4] {
        let [width, height] = self.size().map(i64::from);
        let overscan = i64::from(self.overscan);
        [-overscan, -overscan, width + overscan, height + overscan]
    }

    /// Width and height of the rendered part in pixels; None if it is empty or too large.
    pub fn data_size(&self) -> Option<[u32; 2]> {
        let [x0, y0, x1, y1] = self.data_bounds();
        let side = |from: i64, to: i64| {
            let side = u32::try_from(to - from).ok()?;
            (1..=MAX_SIDE).contains(&side).then_some(side)
        };
        Some([side(x0, x1)?, side(y0, y1)?])
    }

    /// The rendered part of the image, `[x0, y0, x1, y1]`, if it is not the image itself.
    pub fn part(&self) -> Option<[i64; 4]> {
        let [width, height] = self.size().map(i64::from);
        let image = [0, 0, width, height];
        Some(self.data_bounds()).filter(|part| *part != image)
    }

    /// Position of the rendered part in the image.
    pub fn data_window(&self) -> DataWindow {
        let [left, top, ..] = self.data_bounds();
        let pixel = |at: i64| i32::try_from(at).unwrap_or(i32::MIN);
        DataWindow { left: pixel(left), top: pixel(top), image: self.size() }
    }

    /// Checks that the rendered part is in the image.
    pub(super) fn check(&self, root: &mut Section<'_>) {
        let [left, top, right, bottom] = self.largest_bounds();
        if let Some(PixelBounds(bounds)) = self.crop {
            let [x0, y0, x1, y1] = bounds.map(i64::from);
            if x0 >= x1 || y0 >= y1 {
                root.section("image")
                    .wrong("crop", "has no pixels; x0 must be below x1, and y0 below y1");
            } else if x0 < left || y0 < top || x1 > right || y1 > bottom {
                let what = format!(
                    "reaches beyond the image, which is [{left}, {top}, {right}, {bottom}] with its overscan"
                );
                root.section("image").wrong("crop", &what);
            }
        } else if self.data_size().is_none() {
            let what = format!("makes the image larger than {MAX_SIDE} pixels; make it smaller");
            root.section("image").wrong("overscan", &what);
        }
    }
}

named! {
    /// Pattern of the ground.
    GroundPattern {
        /// No pattern.
        Plain = "plain",
        /// Squares, every other one darker.
        Checker = "checker",
        /// Spots of many sizes.
        Sand = "sand",
    }
}

named! {
    /// How far the ground reaches.
    GroundReach {
        /// To the horizon where the camera sees the environment, else near.
        Auto = "auto",
        /// It fades into what is behind at some distance from the particles.
        Near = "near",
        /// To the horizon.
        Far = "far",
    }
}

named! {
    /// Light from other surfaces.
    IndirectSetting {
        /// Paths follow it.
        Traced = "traced",
        /// Paths end at the second surface, with an estimate of its light.
        Ambient = "ambient",
    }
}

named! {
    /// What renders images.
    DeviceSetting {
        /// The CPU.
        Auto = "auto",
        /// The CPU.
        Cpu = "cpu",
        /// A GPU.
        Gpu = "gpu",
    }
}

impl DeviceSetting {
    /// The renderer. Pictures of the CPU and of a GPU may differ in the last bits of colours.
    pub const fn renderer(self) -> RendererKind {
        match self {
            Self::Auto | Self::Cpu => RendererKind::Cpu,
            Self::Gpu => RendererKind::Gpu,
        }
    }
}

section! {
    /// Settings of the renderer
    Render {
        /// What renders the images: auto | cpu | gpu
        ///
        /// gpu needs a program that was built with it, and a GPU with Vulkan (see `spherule devices`). It renders
        /// matte, plastic and metal spheres; a setting that it lacks is an error that names its key. Ids, depths, normals
        /// and positions equal those of the CPU; colours may differ in their last bits. auto is gpu where that is possible
        /// and the GPU is no program on the CPU; else a note has the first reason. A job goes on with the device that it
        /// began with.
        device: DeviceSetting = DeviceSetting::Auto, affects(Affects::Nothing), flag("device", "NAME", "Job");
        /// Acceleration structure: auto, lbvh, kdtree, bvh or sbvh
        ///
        /// lbvh is the fastest to build, kdtree the fastest to trace. The image is the same. auto chooses one of these
        /// two by the number of rays per particle.
        accelerator: Option<Structure> = None, or("auto"), affects(Affects::Nothing),
            flag("accelerator", "NAME", "Job");
        /// Build quality of bvh: fast | medium | high
        bvh_preset: BvhPreset = BvhPreset::default(), affects(Affects::Nothing);
        /// Primitives of bvh: blocks, or particles (200 bytes per particle while building)
        bvh_leaves: BvhLeaves = BvhLeaves::default(), affects(Affects::Nothing);
        /// sbvh tries spatial splits where boxes overlap by more than this fraction of the scene's surface area
        sbvh_alpha: f32 = SbvhSettings::DEFAULT.alpha, affects(Affects::Nothing),
            from(*SbvhSettings::ALPHAS.start()), to(*SbvhSettings::ALPHAS.end());
        /// Maximum number of references per particle that the spatial splits of sbvh add; 0 turns them off
        sbvh_budget: f32 = SbvhSettings::DEFAULT.budget, affects(Affects::Nothing),
            zero("no spatial splits"), from(*SbvhSettings::BUDGETS.start()), to(*SbvhSettings::BUDGETS.end());
        /// Light transport: auto | path | whitted; auto is path
        ///
        /// path is lit by the environment and by lights, and follows the light that surfaces reflect. whitted is the
        /// model of the thesis: lights without extent, ambient light and highlights. A manifest in which one
        /// of the thesis's terms in `[material]` (ambient, diffuse, specular, shininess, reflection, transmission) has
        /// another value than its default, and that names no integrator, is rendered with whitted.
        integrator: Option<IntegratorKind> = None, or("auto"), flag("integrator", "NAME", "Look");
        /// Diffuse reflections that light may take before its last one; 0 is direct light only
        bounces: u32 = DEFAULT_BOUNCES, from(0), to(MAX_BOUNCES), affects(Affects::PathTracing),
            flag("bounces", "COUNT", "Look");
        /// Limit of indirect light: largest radiance that a path adds to a sample after its first bounce, or off
        ///
        /// It removes fireflies, pixels with a rare bright sample, and some light with them; reports have the lost part as
        /// clamped_light. Light that the first surface receives from the environment and lights has no limit. 10 is the
        /// default of Blender.
        clamp: Option<f32> = None, or("off"), above(0), to(MAX_CLAMP), unit("a radiance"),
            affects(Affects::PathTracing);
        /// Limit of noise: tiles of 16x16 pixels take more samples until their noise is below it, or off
        ///
        /// The noise is measured before denoising, and relative to white: 0.02 is hardly seen, 0.1 suits pictures that are
        /// denoised. A tile takes at least image.samples, rounded up to an even number of at least 4, and at most
        /// image.max_samples. It is an estimate, which rare bright samples escape.
        noise: Option<f32> = None, or("off"), above(0), to(MAX_NOISE), unit("a part of white"), flag("noise", "LIMIT", "Look");
        /// Sequence of the random numbers
        ///
        /// Images that differ only in it have the same mean and independent noise, so several of them can be averaged:
        /// the mean of four has half the noise of one. All frames of a job have the same seed; noise stays in its place.
        seed: u32 = 0, from(0), to(MAX_SEED), flag("seed", "NUMBER", "Look");
        /// Light that surfaces receive from other surfaces: traced | ambient
        ///
        /// traced follows it up to `bounces`. ambient ends paths at the second surface and estimates the light there:
        /// it is faster and has less noise, but gaps between particles are too pale. It is for previews (--draft).
        indirect: IndirectSetting = IndirectSetting::Traced, affects(Affects::PathTracing);
        /// Light on ground, meshes and opaque particles through transmissive particles: number of photons; 0 is none
        ///
        /// With photons, paths end at the ground, whose light is computed once for each image. Without photons, paths
        /// go on from the ground, and light of `[[light]]` passes particles in a straight line. Lights without shadows
        /// and point lights with `falloff = "none"` emit no photons.
        caustics: Caustics = Caustics::DEFAULT, affects(Affects::PathTracing);
        /// Removes noise from R, G and B: auto | true | false; auto is true with path
        ///
        /// It takes at least 2 samples per pixel. With output.transparent, it removes noise from shadows in A, too. Other
        /// channels do not change.
        denoise: Option<bool> = None, or("auto"), flag("denoise", "", "Look");
        /// Width of dark outlines around opaque spheres, bonds and bodies, pixels; 0 is none
        outline: f32 = 0.0, from(0), to(100), flag("outline", "PIXELS", "Look");
        /// How much the farthest particles fade into the background, 0 (not at all) to 1
        depth_cue: f32 = 0.0, from(0), to(1), flag("depth-cue", "PART", "Look");
        /// Maximum depth of reflections and refractions; 1 is direct light only
        max_depth: u32 = 3, from(1), to(MAX_DEPTH), flag("max-depth", "MAX_DEPTH", "Look");
        /// Transmissive spheres: path weight below which only one of the two branches is followed; 0 always follows
        /// both
        min_weight: f32 = DEFAULT_MIN_WEIGHT, affects(Affects::BranchingSpheres), or_zero(),
            from(*MIN_WEIGHTS.start()), to(*MIN_WEIGHTS.end());
        /// Background: auto, studio, a colour, or { bottom = [...], top = [...] }
        ///
        /// studio is a grey gradient over the image with darker corners. It does not move with the camera. auto is
        /// studio with path, and a darker gradient along the up axis with whitted.
        background: Option<Background> = None, or("auto"), flag("background", "COLOR", "Look");
        /// Ground under the particles: auto | none (false) | plain (true) | checker | shadow_catcher | image
        ///
        /// A shadow catcher is invisible: it shows the background, darker where particles take light away. It needs
        /// integrator = "path" and has no colour. auto is a shadow catcher with path if particles lie on the floor of
        /// their domain at some time, otherwise false. `[render.ground]` with `type = "checker"` is the same as
        /// ground = "checker". `type = "image"` needs `image`, a PNG, OpenEXR or Radiance HDR file of base colours;
        /// `width` (by default about the diagonal of the box of the particles), `center` (a point above the centre of
        /// the image), `rotation` (counterclockwise from above, degrees) and `repeat` (true; otherwise ground_color is
        /// around it) place it.
        ground: Option<GroundSetting> = None, or("auto"), flag("ground", "KIND", "Look");
        /// Height of the ground along input.up, or auto
        ground_height: Option<f64> = None, or("auto"), unit("a height");
        /// Colour of the ground, linear RGB
        ground_color: Vec3 = ground::DEFAULT_COLOR;
        /// Pattern of the ground: plain | checker (every other square is darker) | sand
        ground_pattern: GroundPattern = GroundPattern::Plain;
        /// Strength of the shadows on a shadow catcher; 1 is physical
        ground_shadow: f32 = 1.0, from(0), to(1), affects(Affects::PathTracing);
        /// How far the ground reaches: auto | near | far
        ///
        /// near fades into what is behind it at six diagonals of the particles, so that there is no horizon. far reaches
        /// the horizon. auto is far where the camera sees the environment, and near in front of a background. Shadow
        /// catchers are always near.
        ground_reach: GroundReach = GroundReach::Auto;
        /// Aerial haze over a ground that reaches far: the distance from the particles at which it has faded out
        haze: Option<f64> = None, example("60.0"), unset("none: the ground fades at the horizon"), unit("a length"), above(0), single();
        /// How much darker and glossier a ground is where water wets it; 1 is a thin film of water, 0 is dry
        ///
        /// Under deep water, its surface already throws light back to the ground, so that 1 is too dark there.
        /// The ground is wet under the liquid and up to about a particle radius beside it. It needs a transparent union
        /// or smooth surface, photons, and a ground that is no shadow catcher.
        ground_wetness: f32 = 0.5, from(0), to(1), affects(Affects::PathTracedBodies);
        /// Edge length of the squares of the pattern, or of its largest spots, or auto
        ground_tile: Option<f64> = None, or("auto"), unit("a length"), above(0), single();
        /// Maximum memory to use: 4GiB, 512MiB; frames that need more fail
        memory_limit: Option<Bytes> = None, example("\"4GiB\""), unset("the free memory"), affects(Affects::Nothing),
            flag("memory-limit", "SIZE", "Job");
    }
}

named!(FilterKind: Box = "box", Gaussian = "gaussian", BlackmanHarris = "blackman-harris");
named!(IntegratorKind: Whitted = "whitted", Path = "path");

impl Named for Structure {
    fn names() -> Vec<(Self, &'static str)> {
        Self::ALL.map(|structure| (structure, structure.name())).to_vec()
    }
}

impl Named for BvhPreset {
    fn names() -> Vec<(Self, &'static str)> {
        Self::ALL.map(|preset| (preset, preset.name())).to_vec()
    }
}

impl Named for BvhLeaves {
    fn names() -> Vec<(Self, &'static str)> {
        Self::ALL.map(|leaves| (leaves, leaves.name())).to_vec()
    }
}
