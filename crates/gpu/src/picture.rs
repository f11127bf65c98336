//! What a picture consists of, apart from its spheres: plain values, in the units of the scene. Colours are linear RGB.

use bytemuck::{Pod, Zeroable};

/// Largest number of lights.
pub const MAX_LIGHTS: usize = 8;

/// A picture to render.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// The camera.
    pub camera: Camera,
    /// Size of the film.
    pub film: FilmSize,
    /// Where the samples of pixels are.
    pub samples: Samples<'a>,
    /// Recursion depth; 1 is direct light only. Rays beyond see the background.
    pub max_depth: u32,
    /// What rays without an intersection see.
    pub background: Background,
    /// Whether camera rays see no background.
    pub is_transparent: bool,
    /// The material of all spheres.
    pub material: Material,
    /// Lights, at most [`MAX_LIGHTS`].
    pub lights: &'a [Light],
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
}

/// A light without extent.
#[derive(Debug, Clone, Copy)]
pub struct Light {
    /// Where it is.
    pub place: LightPlace,
    /// Colour times intensity.
    pub radiance: [f32; 3],
    /// Whether spheres occlude it.
    pub casts_shadow: bool,
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
}

/// The uniform `View` of the shaders.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct View {
    pub(crate) eye: [f32; 3],
    pub(crate) zero: f32,
    pub(crate) right: [f32; 3],
    pub(crate) half_width: f32,
    pub(crate) up: [f32; 3],
    pub(crate) half_height: f32,
    pub(crate) forward: [f32; 3],
    pub(crate) is_parallel: u32,
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
    pub(crate) ambient: [f32; 3],
    pub(crate) diffuse: f32,
    pub(crate) color: [f32; 3],
    pub(crate) specular: f32,
    pub(crate) shininess: f32,
    pub(crate) reflection: f32,
    pub(crate) ior: f32,
    pub(crate) is_exact_fresnel: u32,
    pub(crate) lights: [LightUniform; MAX_LIGHTS],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct LightUniform {
    place: [f32; 3],
    kind: u32,
    radiance: [f32; 3],
    casts_shadow: u32,
}

impl From<&Light> for LightUniform {
    fn from(light: &Light) -> Self {
        let (place, kind) = match light.place {
            LightPlace::Point { position, has_falloff } => (position, u32::from(has_falloff)),
            LightPlace::Distant(direction) => (direction, 2),
        };
        let casts_shadow = light.casts_shadow.into();
        Self { place, kind, radiance: light.radiance, casts_shadow }
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
        let [right, up, forward] = camera.axes;
        let [half_width, half_height] = camera.half_extent;
        let (bottom, top, background_up, background_kind) = match picture.background {
            Background::Constant(color) => (color, color, [0.0; 3], 0),
            Background::Gradient { bottom, top, up } => (bottom, top, up, 1),
        };
        let mut lights = [LightUniform::default(); MAX_LIGHTS];
        for (uniform, light) in lights.iter_mut().zip(picture.lights) {
            *uniform = light.into();
        }
        #[expect(clippy::cast_possible_truncation, reason = "at most MAX_LIGHTS")]
        let light_count = picture.lights.len() as u32;
        Self {
            eye: camera.eye,
            right,
            half_width,
            up,
            half_height,
            forward,
            is_parallel: camera.is_parallel.into(),
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
            ambient: material.ambient,
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
            reflection: material.reflection,
            ior: material.ior,
            is_exact_fresnel: material.is_exact_fresnel.into(),
            lights,
            ..Self::default()
        }
    }
}
