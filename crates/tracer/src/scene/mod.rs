//! Everything in a scene apart from the particles: camera, lights, material, background, ground. These are plain
//! values; `render` computes the transport of light between them.
//!
//! Coordinates are in scene units relative to [`Scene::origin`] (see DESIGN section 4), so that f32 is sufficient
//! wherever the domain of the simulation is. Colours are linear RGB.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

pub mod background;
pub mod camera;
pub mod colormap;
pub mod elements;
pub mod environment;
pub mod framing;
pub mod ground;
pub mod lens;
pub mod light;
pub mod material;
pub mod mist;
pub mod path;
pub mod projection;
pub mod rgb;
mod sand;
pub mod stereo;
pub mod texture;

pub use background::Background;
pub use camera::{Camera, CameraError, CameraView, Lens, Stereo};
pub use colormap::{ColorMap, ColorScale, UnknownColorMap};
pub use elements::RadiusTable;
pub use environment::{Environment, EnvironmentAxes, IrradianceHarmonics, RadianceMap};
pub use framing::{
    DEFAULT_AZIMUTH, DEFAULT_ELEVATION, Framed, Framing, azimuth_toward, view_direction,
};
pub use ground::{Ground, WetGround};
pub use lens::{Aperture, Focus, LensSettings};
pub use light::{Falloff, Light, LightKind, default_lights};
pub use material::{Finish, Fresnel, Material, MaterialError, Owner};
pub use mist::Mist;
pub use path::{CameraKey, CameraPath, KeyedPath, PathError, Turntable};
pub use projection::Projection;
pub use rgb::{RgbEncoding, is_rgb};
pub use spherule_surface::MaterialId;
pub use stereo::{Convergence, StereoSettings};
pub use texture::Texture;

/// An axis-aligned box in world units; includes the spheres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Lowest corner.
    pub min: DVec3,
    /// Highest corner.
    pub max: DVec3,
}

impl Bounds {
    /// The centre.
    pub fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// Length of the space diagonal.
    pub fn diagonal(&self) -> f64 {
        (self.max - self.min).length()
    }

    /// The eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |bit: usize, low: f64, high: f64| if i & bit == 0 { low } else { high };
            DVec3::new(
                pick(1, self.min.x, self.max.x),
                pick(2, self.min.y, self.max.y),
                pick(4, self.min.z, self.max.z),
            )
        })
    }
}

/// Default ambient light: white, so that the `ambient` of a material determines it alone, like `Ka` in the thesis.
pub const DEFAULT_AMBIENT_LIGHT: Vec3 = Vec3::ONE;

/// Colour of foam and spray, linear RGB.
const SPRAY_COLOR: Vec3 = Vec3::splat(0.9);

/// Default colour of meshes and rods, linear RGB: a neutral light grey.
pub const DEFAULT_MESH_COLOR: Vec3 = Vec3::splat(0.6);

/// A scene without its particles.
#[derive(Debug, Clone)]
pub struct Scene {
    /// World position of the origin of all coordinates here and of the particles.
    pub origin: DVec3,
    /// The camera.
    pub camera: Camera,
    /// Point and directional lights.
    pub lights: Vec<Light>,
    /// Ambient light (`ambient` of eq. 4.1).
    pub ambient_light: Vec3,
    /// The materials by [`MaterialId`]: of the particles, of spray and of the ground, and then those of
    /// [`Self::add`], [`Self::add_style`] and [`Self::add_owned`].
    pub materials: Vec<Material>,
    /// Background for rays without an intersection.
    pub background: Background,
    /// Optional ground.
    pub ground: Option<Ground>,
    /// How the fluid wets a visible ground, with path tracing.
    pub wet_ground: Option<WetGround>,
    /// Mist in the air outside all bodies, with path tracing.
    pub mist: Option<Mist>,
    /// Corners of the box of the particles of all frames: the target of photons.
    pub particles: [Vec3; 2],
    /// Light from infinitely far away, for path tracing.
    pub environment: Option<Arc<Environment>>,
    /// Whether camera rays without an intersection see the environment instead of the background.
    pub is_environment_visible: bool,
    /// Index of the light group of the environment; 0 is that of light without a group.
    pub environment_group: u8,
    /// The next frame, for motion on the film.
    pub next_frame: Option<OtherFrame>,
    /// The previous frame, for motion on the film.
    pub previous_frame: Option<OtherFrame>,
    /// What changes while the shutter is open, with motion blur.
    pub exposure: Option<Exposure>,
}

/// What changes in a scene while the shutter is open, apart from the particles.
#[derive(Debug, Clone, Copy)]
pub struct Exposure {
    /// The camera when the shutter opens and when it closes.
    pub cameras: [Camera; 2],
    /// Number of equal parts of the exposure in which surfaces do not change; 1 if they change continuously.
    pub slices: u32,
}

/// Where things are in the next or in the previous frame.
#[derive(Debug, Clone, Copy)]
pub struct OtherFrame {
    /// Its camera.
    pub camera: Camera,
    /// Time from this frame to it, in the unit of the velocities; negative if it is earlier.
    pub time: f32,
}

impl Scene {
    /// Nothing but the default material and white ambient light, in front of black, at the origin of the world.
    pub fn new(camera: Camera) -> Self {
        Self {
            origin: DVec3::ZERO,
            camera,
            lights: Vec::new(),
            ambient_light: Vec3::ONE,
            materials: Self::basic_materials(Material::DEFAULT),
            background: Background::Constant(Vec3::ZERO),
            ground: None,
            wet_ground: None,
            mist: None,
            particles: [Vec3::ZERO; 2],
            environment: None,
            is_environment_visible: false,
            environment_group: 0,
            next_frame: None,
            previous_frame: None,
            exposure: None,
        }
    }

    /// The materials of a scene without meshes, rods and styles.
    pub fn basic_materials(particles: Material) -> Vec<Material> {
        let spray = Material { owner: Owner::Spray, ..Material::matte(SPRAY_COLOR) };
        let basic: [Material; MaterialId::BASIC] = [particles, spray, material::MATTE];
        basic.to_vec()
    }

    /// Adds the material of a mesh or of rods; None if there are [`MaterialId::MAX`] already.
    pub fn add(&mut self, material: Material) -> Option<MaterialId> {
        self.push(material, Owner::Thing)
    }

    /// Adds the material of particles with a style of their own, behind those of other styles; None as in [`Self::add`].
    pub fn add_style(&mut self, material: Material) -> Option<MaterialId> {
        self.push(material, Owner::Style)
    }

    /// Adds a material with this owner; None as in [`Self::add`].
    pub fn add_owned(&mut self, material: Material, owner: Owner) -> Option<MaterialId> {
        let id = MaterialId::at(self.materials.len())?;
        self.materials.push(Material { owner, ..material });
        Some(id)
    }

    /// Adds a material of an owner that counts those of its kind.
    fn push(&mut self, material: Material, owner: fn(u16) -> Owner) -> Option<MaterialId> {
        let kind = std::mem::discriminant(&owner(0));
        let is_of_kind = |m: &&Material| std::mem::discriminant(&m.owner) == kind;
        let number = u16::try_from(self.materials.iter().filter(is_of_kind).count()).ok()?;
        self.add_owned(material, owner(number))
    }

    /// The material with an `id`.
    ///
    /// # Panics
    /// If the id is of another scene that has more materials.
    #[inline(always)]
    pub fn material(&self, id: MaterialId) -> &Material {
        &self.materials[id.index()]
    }

    /// The material of the particles without a style.
    pub fn particle_material(&self) -> &Material {
        self.material(MaterialId::PARTICLES)
    }

    /// The same, to change it.
    pub fn particle_material_mut(&mut self) -> &mut Material {
        &mut self.materials[MaterialId::PARTICLES.index()]
    }

    /// Sets whether spray is drawn as drops that fade out, with path tracing, or as matte spheres.
    pub fn set_spray_soft(&mut self, is_soft: bool) {
        let finish = if is_soft { Finish::Foam } else { Finish::Matte };
        self.materials[MaterialId::SPRAY.index()].finish = finish;
    }

    /// Whether spray is drawn as drops that fade out.
    pub fn is_spray_soft(&self) -> bool {
        self.material(MaterialId::SPRAY).finish == Finish::Foam
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_are_numbered_by_their_owners() {
        let view = CameraView { eye: DVec3::X, look_at: DVec3::ZERO, up: DVec3::Z, fov: 30.0 };
        let mut scene = Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap());
        let part = scene.add_owned(Material::DEFAULT, Owner::Part(0)).unwrap();
        let ids = [0.1, 0.2].map(|grey| scene.add(Material::matte(Vec3::splat(grey))).unwrap());
        let last = scene.add_style(Material::DEFAULT).unwrap();
        assert_eq!([part, ids[0], ids[1], last].map(MaterialId::index), [3, 4, 5, 6]);
        let owners = scene.materials.iter().map(|material| material.owner).collect::<Vec<_>>();
        let [particles, spray, ground] = [Owner::Particles, Owner::Spray, Owner::Ground];
        let added = [Owner::Part(0), Owner::Thing(0), Owner::Thing(1), Owner::Style(0)];
        assert_eq!(owners[..3], [particles, spray, ground]);
        assert_eq!(owners[3..], added);
        // No material is lost or replaced at the end of the numbers
        scene.materials.resize(MaterialId::MAX, Material::DEFAULT);
        assert_eq!(scene.add(Material::DEFAULT), None);
        assert_eq!(scene.materials.len(), MaterialId::MAX);
    }

    #[test]
    fn box_has_eight_corners() {
        let bounds = Bounds { min: DVec3::new(-1.0, 2.0, 3.0), max: DVec3::new(4.0, 5.0, 6.0) };
        let corners = bounds.corners();
        assert_eq!(corners[0], bounds.min);
        assert_eq!(corners[7], bounds.max);
        for (i, a) in corners.iter().enumerate() {
            assert!(corners[i + 1..].iter().all(|b| a != b));
        }
        assert_eq!(bounds.center(), DVec3::new(1.5, 3.5, 4.5));
    }
}
