//! What a picture consists of, apart from its spheres: plain values, in the units of the scene. Colours are linear RGB.

use bytemuck::{Pod, Zeroable};

use spherule_tracer::denoise::DenoiseSettings;
use spherule_tracer::render::PathSeed;

use crate::lighting::{Detail, Lighting, Model, RayKinds, WhittedGround};

/// Largest number of lights.
pub const MAX_LIGHTS: usize = 8;

/// The first light group among the layers of light, as in `shaders/layers.wgsl`.
pub(crate) const FIRST_GROUP: u32 = 10;

/// A picture to render.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// The camera.
    pub camera: Camera,
    /// The camera when the shutter opens and when it closes, if the spheres have displacements.
    pub exposure: Option<[Camera; 2]>,
    /// Size of the film.
    pub film: FilmSize,
    /// Where the samples of pixels are.
    pub samples: Samples<'a>,
    /// How the picture is denoised, if it is; it has at least two samples then.
    pub denoising: Option<Denoising>,
    /// Whether the first surface of each sample is kept, for Cryptomatte.
    pub has_objects: bool,
    /// Number of light groups with that of light without a group, if light is kept by parts; path tracing only.
    pub light_groups: Option<u32>,
    /// The transport of light.
    pub model: Model<'a>,
    /// Recursion depth of Whitted's model, and of paths through transmissive spheres; 1 is direct light only. Rays beyond
    /// see the background or the environment.
    pub max_depth: u32,
    /// What rays without an intersection see.
    pub background: Background,
    /// Whether camera rays see no background.
    pub is_transparent: bool,
    /// The material of all spheres: in path tracing only of transmissive ones.
    pub material: Material,
    /// The least weight of a path both of whose rays go on at transmissive spheres.
    pub split_weight: f32,
    /// Lights, at most [`MAX_LIGHTS`].
    pub lights: &'a [Light],
}

#[cfg(test)]
impl<'a> Picture<'a> {
    /// A picture of what is between 0 and 3 on all axes, from outside, with one sample in the middle of pixels.
    pub(crate) fn for_tests([width, height]: [u32; 2], sets: &'a [u32]) -> Self {
        Self {
            camera: Camera {
                eye: [1.5, -4.0, 1.5],
                axes: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
                half_extent: [0.5, 0.5 * height as f32 / width as f32],
                size: [width as f32, height as f32],
                is_parallel: false,
                lens: None,
            },
            exposure: None,
            film: FilmSize { width, height, corner: [0, 0] },
            samples: Samples { count: 1, points: &[[0.5, 0.5]], sets, seed: 0 },
            denoising: None,
            has_objects: false,
            light_groups: None,
            model: Model::Whitted(None),
            max_depth: 1,
            background: Background::Constant([0.0; 3]),
            is_transparent: false,
            material: Material {
                ambient: [0.1; 3],
                diffuse: 0.9,
                specular: 0.0,
                shininess: 1.0,
                reflection: 0.0,
                ior: 1.5,
                is_exact_fresnel: false,
                transmission: 0.0,
                extinction: [0.0; 3],
                color_length: None,
            },
            split_weight: 1.0,
            lights: &[],
        }
    }
}

impl Picture<'_> {
    /// Whether paths are traced.
    pub(crate) const fn has_paths(&self) -> bool {
        matches!(self.model, Model::Paths(_))
    }

    /// The ground of Whitted's model.
    pub(crate) const fn whitted_ground(&self) -> Option<&WhittedGround> {
        match &self.model {
            Model::Whitted(ground) => ground.as_ref(),
            Model::Paths(_) => None,
        }
    }

    /// The image of the environment at its own resolution.
    pub(crate) fn detail(&self) -> Option<&Detail> {
        let Model::Paths(lighting) = self.model else { return None };
        lighting.environment.as_ref()?.detail.as_ref()
    }

    /// Whether indirect light has a limit.
    pub(crate) const fn has_clamp(&self) -> bool {
        matches!(self.model, Model::Paths(Lighting { indirect_limit: Some(_), .. }))
    }

    /// Whether transmissive spheres are rough.
    pub(crate) const fn has_rough_glass(&self) -> bool {
        matches!(self.model, Model::Paths(Lighting { rough_glass: Some(_), .. }))
    }

    /// What its rays are.
    pub(crate) fn ray_kinds(&self) -> RayKinds {
        RayKinds {
            has_paths: self.has_paths(),
            has_mirrors: matches!(self.model, Model::Paths(Lighting { has_mirrors: true, .. })),
            has_layers: self.light_groups.is_some(),
            kept: self.kept_rays(),
            lights: u32::try_from(self.lights.len()).expect("at most MAX_LIGHTS"),
        }
    }

    /// Number of rays that a pixel keeps for later.
    pub(crate) fn kept_rays(&self) -> Option<u32> {
        (self.material.transmission > 0.0).then(|| most_kept(self.split_weight, self.max_depth))
    }

    /// Number of layers of light.
    pub(crate) fn layer_count(&self) -> u32 {
        self.light_groups.map_or(0, |groups| FIRST_GROUP + groups)
    }

    /// Number of sources of shadow rays.
    pub(crate) fn sources(&self) -> u32 {
        self.ray_kinds().sources()
    }

    /// Whether rays can hit a light.
    pub(crate) fn has_extents(&self) -> bool {
        self.lights.iter().any(|light| light.place.has_extent())
    }
}

/// Number of rays that a pixel keeps at most, if paths split down to a weight. Of two rays, the greater is kept, so that
/// the weight of the other one has halved.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
pub(crate) fn most_kept(split_weight: f32, max_depth: u32) -> u32 {
    let by_weight = (1.0 / split_weight).log2().ceil() as u32;
    // The weights of rays from rough surfaces may add up to a little more than 1
    by_weight.saturating_add(1).min(max_depth.saturating_sub(1)).max(1)
}

/// A camera: the ray through the point `(a, b)` of the film, right and up from its middle, has the direction `forward + a
/// right + b up`; a parallel camera moves the rays instead.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    /// Where rays start.
    pub eye: [f32; 3],
    /// Unit vectors to the right, up and forward.
    pub axes: [[f32; 3]; 3],
    /// Half the width and height of the film.
    pub half_extent: [f32; 2],
    /// Size of the whole image, pixels.
    pub size: [f32; 2],
    /// Whether all rays are parallel.
    pub is_parallel: bool,
    /// Radius of the lens, and distance of the plane in focus.
    pub lens: Option<[f32; 2]>,
}

/// How a picture is denoised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Denoising {
    /// Of the filter.
    pub settings: DenoiseSettings,
    /// Whether colours are at least 0, and coverage is 0 to 1: those of a picture with a shadow catcher.
    pub is_bounded: bool,
}

/// The part of the image that is rendered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FilmSize {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Column and row of its first pixel in the image.
    pub corner: [i32; 2],
}

impl FilmSize {
    /// Number of pixels.
    pub const fn pixels(&self) -> u64 {
        self.width as u64 * self.height as u64
    }
}

/// Points of samples: sets of equal length, and the number of the set of each pixel.
#[derive(Debug, Clone, Copy)]
pub struct Samples<'a> {
    /// Samples of a pixel.
    pub count: u32,
    /// Positions in the pixel, one set after the other.
    pub points: &'a [[f32; 2]],
    /// The set of each pixel, row by row.
    pub sets: &'a [u32],
    /// Sequence of the random numbers of paths.
    pub seed: u32,
}

/// What is infinitely far away.
#[derive(Debug, Clone, Copy)]
pub enum Background {
    /// One colour.
    Constant([f32; 3]),
    /// A gradient by the elevation of rays.
    Gradient {
        /// Colour below.
        bottom: [f32; 3],
        /// Colour above.
        top: [f32; 3],
        /// Unit vector upwards.
        up: [f32; 3],
        /// Whether camera rays see a gradient over the film instead, darker in the corners.
        has_backdrop: bool,
    },
}

/// The constants of equations 4.1 to 4.3 of the thesis.
#[derive(Debug, Clone, Copy)]
pub struct Material {
    /// `Ka` times the ambient light.
    pub ambient: [f32; 3],
    /// `kd`.
    pub diffuse: f32,
    /// `ks`.
    pub specular: f32,
    /// Exponent of the highlight.
    pub shininess: f32,
    /// Weight of the reflected ray.
    pub reflection: f32,
    /// Index of refraction, inside over outside.
    pub ior: f32,
    /// Whether the reflectance is that of a dielectric instead of Schlick's approximation.
    pub is_exact_fresnel: bool,
    /// Weight of the refracted ray; spheres are opaque if it is 0.
    pub transmission: f32,
    /// Extinction in the medium of a sphere, per unit of length.
    pub extinction: [f32; 3],
    /// The length after which white light has the colour of the sphere, too.
    pub color_length: Option<f32>,
}

/// A light.
#[derive(Debug, Clone, Copy)]
pub struct Light {
    /// Where it is.
    pub place: LightPlace,
    /// Colour times intensity.
    pub radiance: [f32; 3],
    /// Whether spheres occlude it.
    pub casts_shadow: bool,
    /// Whether the camera sees it, if it has an extent.
    pub is_visible: bool,
    /// Its light group; 0 is that of light without a group.
    pub group: u32,
}

/// Where a light is.
#[derive(Debug, Clone, Copy)]
pub enum LightPlace {
    /// At a point.
    Point {
        /// The point.
        position: [f32; 3],
        /// Whether it falls off with the square of the distance.
        has_falloff: bool,
    },
    /// Infinitely far away, in the direction of this unit vector.
    Distant([f32; 3]),
    /// A disc infinitely far away: direction, and 1 minus the cosine of half its apparent diameter.
    Sun {
        /// Unit vector towards its centre.
        direction: [f32; 3],
        /// 1 minus the cosine of half the apparent diameter.
        cap: f32,
    },
    /// A sphere.
    Sphere {
        /// Its centre.
        center: [f32; 3],
        /// Its radius.
        radius: f32,
    },
    /// A rectangle or an ellipse that shines to one side.
    Panel {
        /// Its centre.
        center: [f32; 3],
        /// Unit vectors along its width and height, and in the direction that it shines.
        axes: [[f32; 3]; 3],
        /// Half its width and height.
        half: [f32; 2],
        /// Whether it is an ellipse.
        is_ellipse: bool,
    },
}

impl LightPlace {
    /// Whether rays can hit it.
    pub(crate) const fn has_extent(&self) -> bool {
        matches!(self, Self::Sun { .. } | Self::Sphere { .. } | Self::Panel { .. })
    }
}

/// The uniform `View` of the shaders.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct View {
    pub(crate) camera: CameraUniform,
    pub(crate) size: [f32; 2],
    pub(crate) corner: [i32; 2],
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) samples: u32,
    pub(crate) max_depth: u32,
    pub(crate) levels: u32,
    pub(crate) radius: f32,
    pub(crate) padding: f32,
    pub(crate) light_count: u32,
    pub(crate) starts: [u32; 16],
    pub(crate) background_bottom: [f32; 3],
    pub(crate) background_kind: u32,
    pub(crate) background_top: [f32; 3],
    pub(crate) transparent: u32,
    pub(crate) background_up: [f32; 3],
    pub(crate) color_kind: u32,
    pub(crate) lens_radius: f32,
    pub(crate) lens_focus: f32,
    pub(crate) sources: u32,
    pub(crate) has_odd: u32,
    pub(crate) has_extents: u32,
    pub(crate) layer_count: u32,
    pub(crate) sequence: [u32; 2],
    pub(crate) ambient: [f32; 3],
    pub(crate) diffuse: f32,
    pub(crate) color: [f32; 3],
    pub(crate) specular: f32,
    pub(crate) shininess: f32,
    pub(crate) reflection: f32,
    pub(crate) ior: f32,
    pub(crate) is_exact_fresnel: u32,
    pub(crate) extinction: [f32; 3],
    pub(crate) transmission: f32,
    pub(crate) split_weight: f32,
    pub(crate) color_length: f32,
    pub(crate) kept: u32,
    pub(crate) queues: u32,
    pub(crate) sphere_count: u32,
    pub(crate) wide_count: u32,
    pub(crate) first_film: u32,
    pub(crate) first_data: u32,
    pub(crate) open: CameraUniform,
    pub(crate) close: CameraUniform,
    pub(crate) lights: [LightUniform; MAX_LIGHTS],
}

/// The structure `CameraAt` of the shaders.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct CameraUniform {
    eye: [f32; 3],
    zero: f32,
    right: [f32; 3],
    half_width: f32,
    up: [f32; 3],
    half_height: f32,
    forward: [f32; 3],
    is_parallel: u32,
}

impl From<&Camera> for CameraUniform {
    fn from(camera: &Camera) -> Self {
        let [right, up, forward] = camera.axes;
        let [half_width, half_height] = camera.half_extent;
        let is_parallel = camera.is_parallel.into();
        let eye = camera.eye;
        Self { eye, zero: 0.0, right, half_width, up, half_height, forward, is_parallel }
    }
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct LightUniform {
    place: [f32; 3],
    kind: u32,
    radiance: [f32; 3],
    casts_shadow: u32,
    across: [f32; 3],
    is_visible: u32,
    along: [f32; 3],
    group: u32,
    normal: [f32; 3],
    zero_too: f32,
    half: [f32; 2],
    zeros: [f32; 2],
}

impl From<&Light> for LightUniform {
    fn from(light: &Light) -> Self {
        let (place, kind, half) = match light.place {
            LightPlace::Point { position, has_falloff } => (position, has_falloff.into(), [0.0; 2]),
            LightPlace::Distant(direction) => (direction, 2, [0.0; 2]),
            LightPlace::Sun { direction, cap } => (direction, 3, [cap; 2]),
            LightPlace::Sphere { center, radius } => (center, 4, [radius; 2]),
            LightPlace::Panel { center, half, is_ellipse, .. } => {
                (center, 5 + u32::from(is_ellipse), half)
            }
        };
        let [across, along, normal] = match light.place {
            LightPlace::Panel { axes, .. } => axes,
            _ => [[0.0; 3]; 3],
        };
        Self {
            place,
            kind,
            radiance: light.radiance,
            casts_shadow: light.casts_shadow.into(),
            across,
            is_visible: light.is_visible.into(),
            along,
            group: light.group,
            normal,
            half,
            ..Self::default()
        }
    }
}

impl View {
    /// The uniform of a picture, without its tree and the colours of its spheres.
    ///
    /// # Panics
    /// If there are more than [`MAX_LIGHTS`] lights.
    pub(crate) fn new(picture: &Picture<'_>) -> Self {
        assert!(picture.lights.len() <= MAX_LIGHTS, "at most {MAX_LIGHTS} lights");
        let Picture { camera, film, material, .. } = picture;
        let [open, close] = picture.exposure.unwrap_or([*camera; 2]);
        let (bottom, top, background_up, background_kind) = match picture.background {
            Background::Constant(color) => (color, color, [0.0; 3], 0),
            Background::Gradient { bottom, top, up, has_backdrop } => {
                (bottom, top, up, 1 + u32::from(has_backdrop))
            }
        };
        let mut lights = [LightUniform::default(); MAX_LIGHTS];
        for (uniform, light) in lights.iter_mut().zip(picture.lights) {
            *uniform = light.into();
        }
        #[expect(clippy::cast_possible_truncation, reason = "at most MAX_LIGHTS")]
        let light_count = picture.lights.len() as u32;
        let sequence = bytemuck::cast(PathSeed::sequence_bits(picture.samples.seed).to_le_bytes());
        let [lens_radius, lens_focus] = camera.lens.unwrap_or_default();
        Self {
            camera: camera.into(),
            open: (&open).into(),
            close: (&close).into(),
            size: camera.size,
            corner: film.corner,
            width: film.width,
            height: film.height,
            samples: picture.samples.count,
            max_depth: picture.max_depth,
            light_count,
            background_bottom: bottom,
            background_kind,
            background_top: top,
            transparent: picture.is_transparent.into(),
            background_up,
            lens_radius,
            lens_focus,
            sources: picture.sources(),
            has_odd: picture.denoising.is_some().into(),
            has_extents: picture.has_extents().into(),
            layer_count: picture.layer_count(),
            sequence,
            ambient: material.ambient,
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
            reflection: material.reflection,
            ior: material.ior,
            is_exact_fresnel: material.is_exact_fresnel.into(),
            extinction: material.extinction,
            transmission: material.transmission,
            split_weight: picture.split_weight,
            color_length: material.color_length.unwrap_or(-1.0),
            kept: picture.kept_rays().unwrap_or_default(),
            queues: picture.ray_kinds().queues(),
            lights,
            ..Self::default()
        }
    }
}
