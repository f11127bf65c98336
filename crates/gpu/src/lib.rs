//! Renders spheres on a GPU: builds a tree over them in every frame, and traces pictures, with kernels in WGSL through
//! Vulkan (crate `wgpu`). The same kernels run on software drivers, so that tests need no GPU.
//!
//! ```text
//! slices of positions and radii, a Scene -> [gpu] -> the pixels of tracer's Film
//! ```
//!
//! - [`Device`]: adapters, limits, and the self-test of the arithmetic.
//! - [`Spheres`]: the order along a Hilbert curve, blocks of eight, levels of nodes.
//! - [`Renderer`] and [`Picture`]: spheres by Whitted's model, or by path tracing in a [`Lighting`].
//!
//! This crate takes slices and plain values, and returns pixels: it knows no files, jobs or scenes. Which sphere a pixel
//! shows, its depth, normal, position and coverage equal those of the CPU's kernels to the bit, if the device passes
//! the self-test; colours differ by less than half a unit of a 16-bit float. Every run gives the same bytes.
//!
//! ```
//! use spherule_gpu::{
//!     Background, Camera, Centers, Checks, Colors, Device, FilmSize, KeyLength, Light, LightPlace, Material,
//!     Model, NearestSample, Order, Picture, Radii, Renderer, Samples, Spheres, adapters,
//! };
//!
//! # fn main() -> Result<(), spherule_gpu::GpuError> {
//! if adapters().is_empty() {
//!     return Ok(()); // there is nothing to render on
//! }
//! let device = Device::open(0, Checks::Off)?;
//! let mut renderer = Renderer::new(&device);
//! let spheres = Spheres {
//!     centers: Centers::Points(&[[-1.0, 5.0, 0.0], [1.0, 5.0, 0.0]]),
//!     radii: Radii::Common(0.8),
//!     order: Order::Any(KeyLength::Short),
//!     displacements: None,
//!     keeps_codes: false,
//!     keeps_copies: false,
//! };
//! renderer.prepare(&device, &spheres, Colors::Constant([0.8, 0.2, 0.1]))?;
//! let film = FilmSize { width: 16, height: 8, corner: [0, 0] };
//! let picture = Picture {
//!     camera: Camera {
//!         eye: [0.0; 3],
//!         axes: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
//!         half_extent: [0.5, 0.25],
//!         size: [16.0, 8.0],
//!         is_parallel: false,
//!         lens: None,
//!     },
//!     exposure: None,
//!     film,
//!     samples: Samples { count: 1, points: &[[0.5, 0.5]], sets: &[0; 128], seed: 0 },
//!     denoising: None,
//!     has_objects: false,
//!     light_groups: None,
//!     model: Model::Whitted(None),
//!     max_depth: 1,
//!     background: Background::Constant([0.0; 3]),
//!     is_transparent: false,
//!     material: Material {
//!         ambient: [0.1; 3],
//!         diffuse: 0.9,
//!         specular: 0.0,
//!         shininess: 1.0,
//!         reflection: 0.0,
//!         ior: 1.5,
//!         is_exact_fresnel: false,
//!         transmission: 0.0,
//!         extinction: [0.0; 3],
//!         color_length: None,
//!     },
//!     split_weight: 1.0,
//!     lights: &[Light {
//!         place: LightPlace::Distant([0.0, -1.0, 0.0]),
//!         radiance: [1.0; 3],
//!         casts_shadow: true,
//!         is_visible: false,
//!         group: 0,
//!     }],
//! };
//! renderer.trace(&device, &picture, &|_| false)?;
//! let image = renderer.read(&device)?;
//! let nearest = image.pixels().nearest;
//! assert_eq!((nearest[4 * 16 + 4].index, nearest[4 * 16 + 12].index), (0, 1));
//! assert_eq!(nearest[0].index, NearestSample::NONE);
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

mod arithmetic;
mod arrays;
mod batch;
mod commands;
mod denoise;
mod device;
mod error;
mod kernels;
mod lighting;
mod memory;
mod open;
mod picture;
mod pixels;
mod readback;
mod renderer;
mod scene;
mod scene_lighting;
mod self_test;
mod spheres;
mod stored;
mod trace_arrays;
mod tree;
mod tree_kernels;
mod tree_need;

pub use arithmetic::Arithmetic;
pub use device::{AdapterSummary, Checks, Device, adapters};
pub use error::GpuError;
pub use lighting::{
    Catcher, Detail, Environment, Finish, Ground, Lighting, MAX_FINISHES, Model, Rough, TablePlace,
    Tables, WhittedGround,
};
pub use memory::{bytes_per_pixel, host_bytes_per_pixel, largest_array};
pub use picture::{
    Background, Camera, Denoising, FilmSize, Light, LightPlace, MAX_LIGHTS, Material, Picture,
    Samples,
};
pub use pixels::{Cost, HostPixels, LightLayer, NearestSample, Pixels, SampleObject};
pub use readback::PendingPixels;
pub use renderer::{Colors, Renderer};
pub use scene::{HostImage, Missing, PendingImage, SceneError, SceneRenderer, missing, ray_counts};
pub use spheres::{Centers, Encoding, Grid, KeyLength, Order, Radii, Spheres};
pub use tree_need::{MAX_SPHERES, TreeNeed};
