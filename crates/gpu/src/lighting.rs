//! What path tracing needs beside the spheres: environment, ground, materials, in plain values.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use spherule_tracer::scene::environment::DetailMap;

/// Maximum number of groups of spheres that reflect light in different ways.
pub const MAX_FINISHES: usize = 65;

/// How light is transported.
#[derive(Debug, Clone, Copy)]
pub enum Model<'a> {
    /// Whitted's model: ambient light, lights without extent, mirrored rays; and a ground, if there is one.
    Whitted(Option<WhittedGround>),
    /// Path tracing.
    Paths(&'a Lighting),
}

/// What the rays of a picture are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayKinds {
    /// Whether they are parts of paths.
    pub(crate) has_paths: bool,
    /// Whether mirrors see the environment through a shadow catcher.
    pub(crate) has_mirrors: bool,
    /// Whether light is kept by parts.
    pub(crate) has_layers: bool,
    /// Number of rays that a pixel keeps for later, if spheres are transmissive.
    pub(crate) kept: Option<u32>,
    /// Number of lights.
    pub(crate) lights: u32,
}

impl RayKinds {
    /// The first light among the sources of shadow rays: those of paths begin with the environment and their last
    /// segments.
    pub(crate) const fn first_light(self) -> u32 {
        if self.has_paths { 2 } else { 0 }
    }

    /// Number of sources of shadow rays. If there are mirrors, the environment and the lights of a catcher follow.
    pub(crate) const fn sources(self) -> u32 {
        let of_catcher = if self.has_mirrors { 1 + self.lights } else { 0 };
        self.first_light() + self.lights + of_catcher
    }

    /// Number of queues at each depth: of rays that go on, and of shadow rays by source. Refracted rays are counted as if
    /// they had another.
    pub(crate) const fn queues(self) -> u32 {
        1 + self.sources() + self.kept.is_some() as u32
    }

    /// Whether shadow rays of one source are traced together with the rays of the next depth: their light is apart from that
    /// of these rays then. (The queues of paths would need too much memory, and they are so long that the device waits for
    /// the longest ray of each for a small part of the time.)
    pub(crate) const fn has_lit(self) -> bool {
        !self.has_paths
    }

    /// Number of arrays for shadow rays: some are written while others are traced.
    pub(crate) const fn shadow_arrays(self) -> usize {
        if self.has_lit() { 2 } else { 1 }
    }

    /// Memory of a ray that goes on, bytes.
    pub(crate) const fn ray_bytes(self) -> u64 {
        let of_mirrors = if self.has_mirrors { 16 } else { 0 };
        match self.kept {
            None => self.common_bytes() + of_mirrors,
            Some(_) => 64 + of_mirrors,
        }
    }

    /// Memory of the rays that a pixel keeps, bytes.
    pub(crate) fn kept_bytes(self) -> u64 {
        48 * u64::from(self.kept.unwrap_or_default())
    }

    /// Memory of a shadow ray, bytes.
    pub(crate) const fn shadow_bytes(self) -> u64 {
        self.common_bytes() + if self.has_layers { 16 } else { 0 }
    }

    /// Memory of what all rays have, bytes.
    const fn common_bytes(self) -> u64 {
        if self.has_paths { 48 } else { 32 }
    }
}

/// The scene of path tracing.
#[derive(Debug, Clone)]
pub struct Lighting {
    /// Diffuse reflections before the last one.
    pub bounces: u32,
    /// If paths end at the second surface with an estimate: the distance at which half of the light arrives.
    pub ambient_reach: Option<f32>,
    /// The limit of indirect light: the largest component that a ray may add to its sample.
    pub indirect_limit: Option<f32>,
    /// Whether metal and plastic see the environment through a shadow catcher.
    pub has_mirrors: bool,
    /// The environment; None if it is black.
    pub environment: Option<Environment>,
    /// Whether camera rays see it instead of the background.
    pub is_environment_visible: bool,
    /// The light group of the environment.
    pub environment_group: u32,
    /// The ground.
    pub ground: Option<Ground>,
    /// The microfacets of transmissive spheres, if these are rough: the table has the numbers for light from outside, and
    /// those from inside.
    pub rough_glass: Option<Rough>,
    /// How the spheres reflect light, by the index of the first of each group; at least one, and at most
    /// [`MAX_FINISHES`].
    pub finishes: Vec<(u32, Finish)>,
    /// All tables and pixels that [`TablePlace`]s refer to.
    pub tables: Tables,
}

/// Numbers that are too many for a uniform.
#[derive(Debug, Clone, Default)]
pub struct Tables {
    /// Radiance (linear RGB) and density of texels, and pixels of images.
    pub texels: Vec<[f32; 4]>,
    /// Cumulative probabilities, and tables of materials.
    pub constants: Vec<f32>,
    /// Differs from that of all other tables of the process.
    pub version: u64,
}

/// Where a table of an environment is in [`Tables`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TablePlace {
    /// Edge in texels.
    pub side: u32,
    /// Its first texel.
    pub records: u32,
    /// Its first cumulative probability.
    pub ends: u32,
}

/// Light from infinitely far away.
#[derive(Debug, Clone)]
pub struct Environment {
    /// Unit vectors: right, back, up.
    pub axes: [[f32; 3]; 3],
    /// The table that is sampled.
    pub table: TablePlace,
    /// The first pixel of the image, which has 512 columns and 256 rows.
    pub image: u32,
    /// The image at its own resolution, which is seen instead.
    pub detail: Option<Detail>,
    /// Irradiance in spherical harmonics.
    pub harmonics: [[f32; 3]; 9],
}

/// An image of an environment at its own resolution.
#[derive(Debug, Clone)]
pub struct Detail {
    /// Its pixels.
    pub map: Arc<DetailMap>,
    /// A factor on their radiance, linear RGB.
    pub scale: [f32; 3],
}

/// A plane that is visible from above.
#[derive(Debug, Clone, Copy)]
pub struct Ground {
    /// Unit normal.
    pub up: [f32; 3],
    /// Distance from the origin along `up`.
    pub height: f32,
    /// Where distances for fading count from: the middle of a box, and half its size.
    pub center: [f32; 3],
    /// See `center`.
    pub base: [f32; 3],
    /// Distances at which it begins to fade, and has faded out.
    pub fade: [f32; 2],
    /// Linear RGB.
    pub color: [f32; 3],
    /// The edge of the squares of a checkerboard, and the direction of one of their edges.
    pub checker: Option<(f32, [f32; 3])>,
    /// If camera rays see nothing of it but shadows.
    pub catcher: Option<Catcher>,
}

/// A ground that shows shadows only.
#[derive(Debug, Clone, Copy)]
pub struct Catcher {
    /// Strength of the shadows, 0 to 1.
    pub strength: f32,
    /// Radiance that a white ground reflects of the environment if nothing is in the way.
    pub whole: [f32; 3],
    /// The environment times the cosine with the ground.
    pub table: TablePlace,
}

/// A ground in Whitted's model.
#[derive(Debug, Clone, Copy)]
pub struct WhittedGround {
    /// The plane.
    pub plane: Ground,
    /// `Ka` times the ambient light.
    pub ambient: [f32; 3],
    /// `Kd`.
    pub diffuse: f32,
}

/// Reflection of light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finish {
    /// In all directions alike.
    Matte,
    /// A matte base under a rough coat.
    Plastic(Rough),
    /// A rough mirror in the base colour.
    Metal(Rough),
}

/// A rough surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rough {
    /// Width of the distribution of microfacets.
    pub alpha: f32,
    /// Place in [`Tables::constants`] of the light that leaves, for 65 cosines from 0 to 1, and of its mean.
    pub table: u32,
}

/// The uniform `SceneUniform` of the shaders.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct SceneUniform {
    axis_right: [f32; 3],
    catcher_strength: f32,
    axis_back: [f32; 3],
    reach: f32,
    axis_up: [f32; 3],
    bounces: u32,
    catcher_whole: [f32; 3],
    is_catcher: u32,
    ground_up: [f32; 3],
    ground_height: f32,
    ground_center: [f32; 3],
    fade_start: f32,
    ground_base: [f32; 3],
    fade_end: f32,
    ground_color: [f32; 3],
    ground_kind: u32,
    ground_across: [f32; 3],
    ground_tile: f32,
    ground_ambient: [f32; 3],
    ground_diffuse: f32,
    environment: [u32; 4],
    catcher: [u32; 4],
    image: u32,
    is_environment_visible: u32,
    indirect_limit: f32,
    finish_count: u32,
    detail_scale: [f32; 3],
    is_ambient: u32,
    detail_size: [u32; 2],
    environment_group: u32,
    zero: u32,
    glass_alpha: f32,
    glass_table: u32,
    glass_zeros: [u32; 2],
    finishes: [FinishUniform; MAX_FINISHES],
    harmonics: [[f32; 4]; 9],
}

/// The structure `Finish` of the shaders.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct FinishUniform {
    first: u32,
    kind: u32,
    alpha: f32,
    albedo_table: u32,
}

impl From<&(u32, Finish)> for FinishUniform {
    fn from((first, finish): &(u32, Finish)) -> Self {
        let (kind, rough) = match finish {
            Finish::Matte => (0, Rough { alpha: 1.0, table: 0 }),
            Finish::Plastic(rough) => (1, *rough),
            Finish::Metal(rough) => (2, *rough),
        };
        Self { first: *first, kind, alpha: rough.alpha, albedo_table: rough.table }
    }
}

impl From<TablePlace> for [u32; 4] {
    fn from(place: TablePlace) -> Self {
        [place.side, place.records, place.ends, 0]
    }
}

impl From<&Lighting> for SceneUniform {
    fn from(lighting: &Lighting) -> Self {
        let mut uniform = Self {
            bounces: lighting.bounces,
            is_ambient: lighting.ambient_reach.is_some().into(),
            reach: lighting.ambient_reach.unwrap_or_default(),
            is_environment_visible: lighting.is_environment_visible.into(),
            environment_group: lighting.environment_group,
            indirect_limit: lighting.indirect_limit.unwrap_or_default(),
            ..Self::zeroed()
        };
        if let Some(Rough { alpha, table }) = lighting.rough_glass {
            (uniform.glass_alpha, uniform.glass_table) = (alpha, table);
        }
        for (place, finish) in uniform.finishes.iter_mut().zip(&lighting.finishes) {
            *place = finish.into();
            uniform.finish_count += 1;
        }
        if let Some(environment) = &lighting.environment {
            [uniform.axis_right, uniform.axis_back, uniform.axis_up] = environment.axes;
            uniform.environment = environment.table.into();
            uniform.image = environment.image;
            if let Some(detail) = &environment.detail {
                uniform.detail_size =
                    detail.map.size().map(|side| u32::try_from(side).expect("below 2^32 pixels"));
                uniform.detail_scale = detail.scale;
            }
            uniform.harmonics = environment.harmonics.map(|[r, g, b]| [r, g, b, 0.0]);
        }
        if let Some(ground) = &lighting.ground {
            uniform.set_ground(ground);
        }
        uniform
    }
}

impl From<&WhittedGround> for SceneUniform {
    fn from(ground: &WhittedGround) -> Self {
        let mut uniform = Self {
            ground_ambient: ground.ambient,
            ground_diffuse: ground.diffuse,
            ..Self::zeroed()
        };
        uniform.set_ground(&ground.plane);
        uniform
    }
}

impl SceneUniform {
    fn set_ground(&mut self, ground: &Ground) {
        self.ground_up = ground.up;
        self.ground_height = ground.height;
        self.ground_center = ground.center;
        self.ground_base = ground.base;
        [self.fade_start, self.fade_end] = ground.fade;
        self.ground_color = ground.color;
        self.ground_kind = 1;
        if let Some((tile, across)) = ground.checker {
            self.ground_kind = 2;
            self.ground_tile = tile;
            self.ground_across = across;
        }
        if let Some(catcher) = &ground.catcher {
            self.is_catcher = 1;
            self.catcher_strength = catcher.strength;
            self.catcher_whole = catcher.whole;
            self.catcher = catcher.table.into();
        }
    }
}
