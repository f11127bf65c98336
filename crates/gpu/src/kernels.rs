//! The kernels that trace pictures, compiled for what a picture needs: other pictures have none of its code.

use crate::Device;
use crate::commands::Kernel;
use crate::picture::Picture;
use crate::spheres::Encoding;
use crate::tree::TreeShape;
use crate::tree_kernels::{CODED_CENTERS, GROUPS, encoding_constant, tree_constants};

/// Entries of the traversal's stack for each level of nodes: all children but the one that is visited next.
const STACK_PER_LEVEL: u32 = 7;
/// Levels that the shortest stack holds. Fewer levels do not make it faster.
const MIN_STACK_LEVELS: u32 = 6;

/// Invocations in a workgroup: `GROUP` of the shaders.
pub(crate) const GROUP: u32 = 64;

/// Width and height of the tile of pixels whose camera rays are one workgroup, if `batch` samples of each are traced
/// together: a power of two, at most [`GROUP`].
pub(crate) const fn tile_of(batch: u32) -> [u32; 2] {
    let bits = (GROUP / batch).ilog2();
    [1 << bits.div_ceil(2), 1 << (bits / 2)]
}

/// Kernels for trees of one kind.
#[derive(Debug)]
pub(crate) struct Kernels {
    pub(crate) empty_queues: Kernel,
    pub(crate) trace_camera: Kernel,
    pub(crate) trace_next: Kernel,
    pub(crate) trace_shadow: Kernel,
    /// If pixels have several samples.
    pub(crate) add_batch: Option<Kernel>,
    /// If indirect light has a limit.
    pub(crate) clamp_indirect: Option<Kernel>,
    /// If the picture is denoised.
    pub(crate) store_features: Option<Kernel>,
}

/// What the source of the kernels depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Variant {
    /// Whether paths are traced.
    has_paths: bool,
    /// Whether there is the uniform of paths, or of a ground.
    has_scene: bool,
    /// Whether the light of shadow rays is apart from that of other rays.
    has_lit: bool,
    /// Whether the colours of spheres have an opacity each.
    colors_have_opacity: bool,
    /// Whether it matters: transmissive spheres have an inside.
    has_opacity: bool,
    /// Whether indirect light has a limit.
    has_clamp: bool,
    /// Whether the environment has an image at its own resolution.
    has_detail: bool,
    /// Whether mirrors see the environment through a shadow catcher.
    has_mirrors: bool,
    /// Whether the first surfaces of samples are kept.
    has_objects: bool,
    /// Whether light is kept by parts.
    has_layers: bool,
    /// Whether the picture is denoised.
    is_denoised: bool,
    /// Whether spheres are transmissive.
    has_glass: bool,
    /// Whether they are rough then.
    is_rough: bool,
    /// Whether radii are equal.
    is_common: bool,
    /// Whether spheres and the camera move while the shutter is open.
    has_motion: bool,
    /// How centres are stored that stay coded.
    kept_encoding: Option<Encoding>,
    /// Levels that the stack holds.
    levels: u32,
    /// Samples of a pixel that are traced together.
    batch: u32,
    /// Whether pixels have no others.
    is_single: bool,
}

/// The sources of path tracing.
const PATHS: [&str; 5] = [
    include_str!("shaders/scene.wgsl"),
    include_str!("shaders/environment.wgsl"),
    include_str!("shaders/ground.wgsl"),
    include_str!("shaders/bsdf.wgsl"),
    include_str!("shaders/path.wgsl"),
];
const SMOOTH_GLASS: [&str; 2] =
    [include_str!("shaders/glass.wgsl"), include_str!("shaders/smooth_glass.wgsl")];
const ROUGH_GLASS: [&str; 2] =
    [include_str!("shaders/glass.wgsl"), include_str!("shaders/rough_glass.wgsl")];
const WHITTED: [&str; 2] =
    [include_str!("shaders/no_ground.wgsl"), include_str!("shaders/whitted.wgsl")];
const WHITTED_ON_GROUND: [&str; 3] = [
    include_str!("shaders/scene.wgsl"),
    include_str!("shaders/ground.wgsl"),
    include_str!("shaders/whitted.wgsl"),
];

impl Variant {
    /// What a picture of a tree needs.
    pub(crate) fn of(
        picture: &Picture<'_>,
        shape: &TreeShape,
        has_opacity: bool,
        batch: u32,
    ) -> Self {
        let has_glass = picture.kept_rays().is_some();
        let has_mirrors = picture.ray_kinds().has_mirrors;
        assert!(!has_glass || !has_mirrors, "clear spheres are no mirrors");
        Self {
            colors_have_opacity: has_opacity,
            has_paths: picture.has_paths(),
            has_scene: picture.has_paths() || picture.whitted_ground().is_some(),
            has_lit: picture.ray_kinds().has_lit(),
            has_opacity: has_opacity && !has_glass,
            has_clamp: picture.has_clamp(),
            has_detail: picture.detail().is_some(),
            has_mirrors,
            has_objects: picture.has_objects,
            has_layers: picture.light_groups.is_some(),
            is_denoised: picture.denoising.is_some(),
            has_glass,
            is_rough: picture.has_rough_glass(),
            is_common: shape.is_common,
            has_motion: shape.has_motion,
            kept_encoding: shape.kept_encoding(),
            levels: shape.levels.max(MIN_STACK_LEVELS),
            batch,
            is_single: picture.samples.count == 1,
        }
    }

    /// The constants of the shaders.
    fn constants(self) -> String {
        let flags = [
            ("HAS_OPACITY", self.has_opacity),
            ("HAS_CLAMP", self.has_clamp),
            ("HAS_LIT", self.has_lit),
            ("IS_SINGLE", self.is_single),
            ("HAS_DETAIL", self.has_detail),
            ("HAS_MIRRORS", self.has_mirrors),
            ("HAS_OBJECTS", self.has_objects),
            ("HAS_LAYERS", self.has_layers),
            ("HAS_GLASS", self.has_glass),
        ];
        let flags = flags.map(|(name, value)| format!("const {name}: bool = {value};\n"));
        let stack = format!("const STACK: u32 = {}u;\n", STACK_PER_LEVEL * self.levels);
        let color =
            format!("const COLOR: u32 = {}u;\n", if self.colors_have_opacity { 4 } else { 3 });
        let [width, height] = tile_of(self.batch);
        let batch = format!(
            "const BATCH: u32 = {}u;\nconst TILE_WIDTH: u32 = {width}u;\nconst TILE_HEIGHT: u32 = {height}u;\n",
            self.batch
        );
        [stack, color, batch, flags.concat()].concat()
    }
}

impl Variant {
    /// The source of the kernels. `part` is the constant that divides coded centres between two arrays.
    fn source(self, device: &Device, part: &str) -> String {
        let append = if device.has_subgroups() {
            include_str!("shaders/append_subgroup.wgsl")
        } else {
            include_str!("shaders/append_atomic.wgsl")
        };
        let motion = if self.has_motion {
            include_str!("shaders/moving.wgsl")
        } else {
            include_str!("shaders/still.wgsl")
        };
        let glass: &[&str] = if self.is_rough {
            &ROUGH_GLASS
        } else if self.has_glass {
            &SMOOTH_GLASS
        } else {
            &[include_str!("shaders/opaque.wgsl")]
        };
        let model: &[&str] = if self.has_paths {
            &PATHS
        } else if self.has_scene {
            &WHITTED_ON_GROUND
        } else {
            &WHITTED
        };
        let spheres = match self.kept_encoding {
            None => include_str!("shaders/decoded_spheres.wgsl").to_owned(),
            Some(encoding) => [
                part,
                &encoding_constant(encoding),
                CODED_CENTERS,
                include_str!("shaders/coded_spheres.wgsl"),
            ]
            .concat(),
        };
        [
            device.arithmetic().source(),
            &tree_constants(self.is_common),
            motion,
            &spheres,
            &self.constants(),
            GROUPS,
            include_str!("shaders/view.wgsl"),
            include_str!("shaders/arithmetic.wgsl"),
            include_str!("shaders/functions.wgsl"),
            include_str!("shaders/traverse.wgsl"),
            include_str!("shaders/camera.wgsl"),
            include_str!("shaders/surface.wgsl"),
            include_str!("shaders/clear.wgsl"),
            include_str!("shaders/lights.wgsl"),
            include_str!("shaders/layers.wgsl"),
            include_str!("shaders/queues.wgsl"),
            include_str!("shaders/sampler.wgsl"),
            include_str!("shaders/segments.wgsl"),
            append,
            &glass.concat(),
            &model.concat(),
            if self.is_denoised { include_str!("shaders/features.wgsl") } else { "" },
        ]
        .concat()
    }
}

impl Kernels {
    /// Compiles the kernels.
    ///
    /// `part` is the constant that divides coded centres between two arrays.
    pub(crate) fn new(device: &Device, variant: Variant, part: &str) -> Self {
        let module = device.module(&variant.source(device, part));
        let kernel = |entry, bindings: &[u32]| Kernel::new(device, &module, entry, bindings);
        let of_motion: &[u32] = if variant.has_motion { &[22] } else { &[] };
        // The sample of a shadow ray only matters for its time
        let of_time: &[u32] = if variant.has_motion { &[18] } else { &[] };
        let of_spheres: &[u32] = match variant.kept_encoding {
            None => &[2, 3],
            Some(_) => &[24, 25, 26, 27],
        };
        // Rays that glass ends see the background, which is a part of the light
        let of_glass: &[u32] = if variant.has_glass { &[23] } else { &[] };
        let of_end: &[u32] = if variant.has_glass && !variant.has_paths { &[21] } else { &[] };
        let of_scene: &[u32] = if variant.has_scene { &[15] } else { &[] };
        let tracing = |entry, bindings: &[u32]| {
            kernel(entry, &[bindings, of_spheres, of_motion, of_scene].concat())
        };
        let [camera, next, shadow]: [&[u32]; 3] = if variant.has_paths {
            [
                &[0, 1, 4, 5, 6, 7, 8, 10, 11, 12, 13, 16, 17, 18, 19, 20, 21],
                &[0, 1, 6, 7, 8, 9, 10, 11, 12, 13, 16, 17, 18, 19, 20, 21],
                &[0, 1, 6, 8, 12, 13, 21, 29],
            ]
        } else {
            [
                &[0, 1, 4, 5, 6, 7, 8, 10, 11, 12, 13, 18, 20, 21],
                &[0, 1, 6, 7, 8, 9, 10, 11, 12, 13, 18, 20, 29],
                &[0, 1, 6, 8, 12, 13, 29],
            ]
        };
        Self {
            empty_queues: kernel("empty_queues", &[8, 13, 14]),
            trace_camera: tracing("trace_camera", &[camera, of_glass].concat()),
            trace_next: tracing("trace_next", &[next, of_glass, of_end].concat()),
            trace_shadow: tracing("trace_shadow", &[shadow, of_time].concat()),
            add_batch: (!variant.is_single || variant.has_lit)
                .then(|| kernel("add_batch", &[0, 6, 7, 18])),
            clamp_indirect: (variant.has_clamp)
                .then(|| kernel("clamp_indirect", &[0, 6, 8, 9, 13, 15, 21])),
            store_features: (variant.is_denoised)
                .then(|| kernel("store_features", &[&[0, 7, 12, 28], of_scene].concat())),
        }
    }
}
