//! The shots: small, made of numbers alone, and each about one thing.

use glam::{DVec3, Vec3};
use spherule::render::{Channels, Colors, FilmPlane, RenderSettings};
use spherule::scene::{
    Background, Bounds, Camera, CameraView, ColorMap, Convergence, Falloff, Fresnel, Ground, Light,
    Material, Owner, Projection, Scene, StereoSettings,
};
use spherule::surface::cut::ConvexRegion;
use spherule::surface::{NormalKind, SurfaceKind, SurfaceSettings};

mod bodies;
mod studio;

pub(super) use bodies::{pca_normals, smooth, union};
pub(super) use studio::studio;

const WIDTH: u32 = 96;
const HEIGHT: u32 = 54;

const RED: Vec3 = Vec3::new(0.8, 0.1, 0.05);
const GREEN: Vec3 = Vec3::new(0.1, 0.6, 0.1);
const BLUE: Vec3 = Vec3::new(0.1, 0.25, 0.8);
const GREY: Vec3 = Vec3::new(0.5, 0.5, 0.5);

/// Orange below, blue above: shows at once what is upside down.
const SUNSET: Background = Background::Gradient {
    bottom: Vec3::new(0.9, 0.35, 0.05),
    top: Vec3::new(0.05, 0.2, 0.9),
    up: Vec3::Z,
};

/// Light on surfaces only: nothing mirrored, nothing let through. Spelled out, so that new
/// defaults of the program do not change these pictures.
const MATT: Material = Material {
    owner: Owner::Particles,
    color: None,
    is_holdout: false,
    is_underlay: false,
    ambient: 0.1,
    diffuse: 0.7,
    specular: 0.0,
    shininess: 32.0,
    ior: 1.33,
    reflection: 0.0,
    transmission: 0.0,
    fresnel: Fresnel::Schlick,
    extinction: Vec3::ZERO,
    color_length: None,
    scattering: Vec3::ZERO,
    anisotropy: 0.0,
    finish: spherule::scene::Finish::Matte,
    interface_roughness: 0.0,
    priority: 0,
};

/// Each particle a ball of its own; a smooth surface has voxels of a particle radius. Spelled out, too.
const SPHERES: SurfaceSettings = SurfaceSettings {
    kind: SurfaceKind::Spheres,
    normals: NormalKind::Sphere,
    smoothing: 0.75,
    exact: false,
    voxel: 1.0,
    smoothing_length: 2.0,
    threshold: 0.6,
    spray: false,
    spray_style: spherule::surface::SprayStyle::Spheres,
    whitewater: false,
    whitewater_speed: None,
    whitewater_amount: 1.0,
    whitewater_size: 1.0,
};

/// Owned colours.
pub(super) enum Paint {
    Each(Vec<Vec3>),
    Mapped(Vec<f32>, ColorMap),
}

impl Paint {
    pub(super) fn as_colors(&self) -> Colors<'_> {
        match self {
            Self::Each(colors) => Colors::PerParticle(colors),
            Self::Mapped(values, map) => Colors::Mapped { values, map },
        }
    }
}

/// Everything that a picture is made of.
pub(super) struct Shot {
    pub(super) centers: Vec<Vec3>,
    /// One for all, or one each.
    pub(super) radii: Vec<f32>,
    pub(super) colors: Paint,
    pub(super) ids: Option<Vec<u32>>,
    pub(super) velocities: Option<Vec<Vec3>>,
    pub(super) surface: SurfaceSettings,
    pub(super) cut: ConvexRegion,
    pub(super) scene: Scene,
    pub(super) settings: RenderSettings,
}

impl Shot {
    /// Matt grey balls before a plain dark background, seen along +y from `eye`.
    fn new(centers: Vec<Vec3>, radius: f32, eye: DVec3, look_at: DVec3) -> Self {
        let view = CameraView { eye, look_at, up: DVec3::Z, fov: 35.0 };
        let aspect = f64::from(WIDTH) / f64::from(HEIGHT);
        Self {
            colors: Paint::Each(vec![GREY; centers.len()]),
            centers,
            radii: vec![radius],
            ids: None,
            velocities: None,
            surface: SPHERES,
            cut: ConvexRegion::default(),
            scene: Scene {
                lights: vec![sun(Vec3::new(0.4, 0.7, -1.0), 0.9)],
                materials: Scene::basic_materials(MATT),
                background: Background::Constant(Vec3::new(0.02, 0.03, 0.05)),
                ..Scene::new(Camera::new(&view, aspect, DVec3::ZERO).expect("a camera"))
            },
            settings: RenderSettings {
                samples: 4,
                // Equation 4.1 to the letter.
                min_weight: 0.0,
                ..RenderSettings::new(WIDTH, HEIGHT)
            },
        }
    }

    /// Of another size and the same shape.
    fn sized(mut self, width: u32) -> Self {
        (self.settings.width, self.settings.height) = (width, width * HEIGHT / WIDTH);
        self
    }

    /// From another camera at `eye`, which looks at the origin or, if it is there, along +y.
    fn project(&mut self, eye: DVec3, projection: Projection, eyes: Option<StereoSettings>) {
        let view = CameraView {
            eye,
            look_at: if eye == DVec3::ZERO { DVec3::Y } else { DVec3::ZERO },
            up: DVec3::Z,
            fov: 35.0,
        };
        let aspect = f64::from(WIDTH) / f64::from(HEIGHT);
        let camera = Camera::projected(&view, projection, aspect, DVec3::ZERO).expect("a camera");
        let eyes = eyes.map(|eyes| eyes.stereo(&view).expect("eyes"));
        self.scene.camera = camera.with_stereo(eyes);
        let [columns, rows] = self.scene.camera.eyes();
        (self.settings.width, self.settings.height) = (columns * WIDTH, rows * HEIGHT);
    }

    /// With one colour each.
    fn painted(mut self, colors: &[Vec3]) -> Self {
        assert_eq!(colors.len(), self.centers.len());
        self.colors = Paint::Each(colors.to_vec());
        self
    }
}

/// White light that travels along `direction`.
fn sun(direction: Vec3, strength: f32) -> Light {
    Light::directional(direction, Vec3::splat(strength)).expect("a direction")
}

/// A lattice of `columns` by `rows` in the plane y = 0, `spacing` apart, around the z axis.
fn wall(columns: u16, rows: u16, spacing: f32) -> Vec<Vec3> {
    let middle = |count: u16| 0.5 * (f32::from(count) - 1.0);
    let place = |i: u16, count: u16| spacing * (f32::from(i) - middle(count));
    let row = |k| (0..columns).map(move |i| Vec3::new(place(i, columns), 0.0, place(k, rows)));
    (0..rows).flat_map(row).collect()
}

/// A layer of balls and three above it, lit from straight above: their shadows lie under them.
pub(super) fn shadow() -> Shot {
    let mut centers: Vec<Vec3> = wall(9, 7, 1.0).iter().map(|p| Vec3::new(p.x, p.z, 0.0)).collect();
    centers.extend([(-2.5, 0.0), (0.0, 1.0), (2.5, -1.0)].map(|(x, y)| Vec3::new(x, y, 2.0)));
    let mut shot = Shot::new(centers, 0.5, DVec3::new(0.0, -11.0, 6.5), DVec3::new(0.0, 0.0, 0.4));
    shot.scene.lights = vec![Light::point(DVec3::new(0.0, 0.0, 50.0), DVec3::ZERO, Vec3::ONE)];
    let mut colors = vec![GREY; 63];
    colors.extend([RED, GREEN, BLUE]);
    shot.painted(&colors)
}

/// A packing of overlapping balls, cut by an oblique plane and from above: flat faces in the colours of the balls, with
/// the shadow of a ball that lies in front of them.
pub(super) fn cut() -> Shot {
    let mut centers = Vec::new();
    for layer in [-1.0, 0.0, 1.0] {
        let row = wall(5, 3, 0.85).into_iter();
        centers.extend(row.map(|p| p.with_y(0.85 * layer)));
    }
    centers.push(Vec3::new(-1.2, -2.2, 0.6));
    let mut shot = Shot::new(centers, 0.5, DVec3::new(-2.0, -7.0, 4.5), DVec3::ZERO);
    shot.radii = (0..46).map(|i| [0.5, 0.38, 0.55][i % 3]).collect();
    shot.radii[45] = 0.3;
    shot.cut.cut(DVec3::new(0.0, 0.0, 0.75), DVec3::Z);
    let normal = DVec3::new(2.0, -3.0, 1.0).normalize();
    shot.cut.cut(0.55 * normal, normal);
    let colors = [RED, GREEN, BLUE, GREY];
    shot.settings.channels = Channels::COLOR.with(&[FilmPlane::Id, FilmPlane::Normal]);
    shot.painted(&(0..46).map(|i| colors[i % 4]).collect::<Vec<_>>())
}

/// Metal balls that show each other and the sky.
pub(super) fn reflection() -> Shot {
    let centers =
        vec![Vec3::new(0.0, 0.0, 0.0), Vec3::new(-2.2, -0.3, 0.0), Vec3::new(2.2, -0.3, 0.0)];
    let mut shot = Shot::new(centers, 1.0, DVec3::new(0.0, -8.0, 0.8), DVec3::ZERO);
    *shot.scene.particle_material_mut() = Material {
        diffuse: 0.35,
        specular: 0.2,
        // A head-on reflection of 0.6.
        ior: 8.0,
        reflection: 1.0,
        ..MATT
    };
    shot.scene.background = SUNSET;
    shot.settings.max_depth = 4;
    shot.painted(&[GREY, RED, GREEN])
}

/// A large ball of glass before a red ball above and a green one below: through it they have
/// changed places, and so has the sky.
pub(super) fn refraction() -> Shot {
    let centers = vec![
        Vec3::new(0.0, 0.0, 0.0),
        Vec3::new(0.0, 8.0, 1.3),
        Vec3::new(0.0, 8.0, -1.3),
        Vec3::new(-3.2, 3.0, 1.0),
        Vec3::new(-3.2, 3.0, -1.0),
    ];
    let mut shot = Shot::new(centers, 1.0, DVec3::new(0.0, -5.5, 0.0), DVec3::ZERO);
    shot.radii = vec![1.5, 0.9, 0.9, 0.7, 0.7];
    *shot.scene.particle_material_mut() = glass(1.5);
    shot.scene.background = SUNSET;
    shot.scene.lights = vec![sun(Vec3::new(0.0, 1.0, -0.3), 1.0)];
    shot.settings.max_depth = 5;
    shot.painted(&[Vec3::ZERO, RED, GREEN, RED, GREEN])
}

fn glass(ior: f32) -> Material {
    Material { ior, reflection: 1.0, transmission: 1.0, ..MATT }
}

/// Bubbles of air in water: beyond the critical angle (48.6 degrees, 0.75 of the radius) they
/// mirror everything.
pub(super) fn total_reflection() -> Shot {
    let centers = vec![Vec3::new(-1.6, 0.0, 0.0), Vec3::new(1.6, 0.0, 0.0)];
    let mut shot = Shot::new(centers, 1.4, DVec3::new(0.0, -7.0, 0.0), DVec3::ZERO);
    *shot.scene.particle_material_mut() = glass(1.0 / 1.333);
    shot.scene.background = SUNSET;
    shot.settings.max_depth = 6;
    shot.painted(&[Vec3::ZERO; 2])
}

/// Glass dims light at each crossing: more at the rim of its shadow than in the middle.
pub(super) fn shadow_through_glass() -> Shot {
    let centers = vec![Vec3::new(0.0, 0.0, 1.6), Vec3::new(2.2, 0.6, 1.0)];
    let mut shot = Shot::new(centers, 1.0, DVec3::new(0.5, -9.0, 5.0), DVec3::new(0.8, 0.0, 0.5));
    *shot.scene.particle_material_mut() = Material { transmission: 0.8, ..glass(1.5) };
    shot.scene.lights = vec![sun(Vec3::new(0.3, 0.1, -1.0), 1.2)];
    shot.scene.ground = Some(floor(0.0));
    shot.settings.max_depth = 5;
    shot.painted(&[BLUE * 0.3, RED * 0.3])
}

/// A light floor at `height` that ends 12 units out.
fn floor(height: f32) -> Ground {
    Ground {
        base: Vec3::ZERO,
        up: Vec3::Z,
        height,
        color: GREY,
        center: Vec3::Z * height,
        fade_start: 4.0,
        fade_end: 12.0,
        lit_range: 4.0,
        pattern: spherule::scene::ground::Pattern::Plain,
        shadow_catcher: None,
    }
}

fn mapped(name: &str) -> Shot {
    let centers = wall(16, 8, 0.5);
    // From below 0 to above 1, left to right, and no number at the right end of the top row.
    let mut values: Vec<f32> = centers.iter().map(|p| 0.5 + p.x / 7.0).collect();
    if let Some(last) = values.last_mut() {
        *last = f32::NAN;
    }
    let mut shot = Shot::new(centers, 0.25, DVec3::new(0.0, -8.0, 0.0), DVec3::ZERO);
    shot.scene.lights = vec![sun(Vec3::new(0.2, 1.0, -0.3), 1.2)];
    let map = ColorMap::new(name, 0.0, 1.0).expect("a map");
    shot.colors = Paint::Mapped(values, map);
    shot
}

/// Dark violet to yellow.
pub(super) fn viridis() -> Shot {
    mapped("viridis")
}

/// Blue to red.
pub(super) fn turbo() -> Shot {
    mapped("turbo")
}

/// Balls that grow to the right and upwards.
pub(super) fn radius_per_particle() -> Shot {
    let centers = wall(12, 6, 0.6);
    let radii = centers.iter().map(|p| 0.15 + 0.03 * (p.x + p.z)).collect();
    let mut shot = Shot::new(centers, 0.3, DVec3::new(0.0, -8.0, 0.0), DVec3::ZERO);
    shot.radii = radii;
    shot
}

/// A floor under the balls takes their shadows and fades into the background.
pub(super) fn ground() -> Shot {
    let centers =
        vec![Vec3::new(-1.8, 0.0, 1.0), Vec3::new(0.6, -0.8, 0.6), Vec3::new(2.0, 0.5, 0.8)];
    let mut shot = Shot::new(centers, 1.0, DVec3::new(0.0, -9.0, 3.0), DVec3::new(0.0, 0.0, 0.8));
    shot.radii = vec![1.0, 0.6, 0.8];
    let bounds = Bounds { min: DVec3::new(-2.8, -1.4, 0.0), max: DVec3::new(2.8, 1.3, 2.0) };
    shot.scene.ground = Some(Ground {
        color: Vec3::new(0.135, 0.140, 0.150),
        ..Ground::under(&bounds, Vec3::Z, DVec3::ZERO)
    });
    shot.scene.lights = vec![sun(Vec3::new(1.0, 0.4, -1.2), 1.2)];
    shot.painted(&[RED, GREEN, BLUE])
}

/// Nothing but three balls before a sky.
pub(super) fn gradient_background() -> Shot {
    let centers = wall(3, 1, 2.4);
    let mut shot = Shot::new(centers, 0.8, DVec3::new(0.0, -7.0, 0.0), DVec3::ZERO);
    shot.scene.background = SUNSET;
    shot
}

/// A lamp above the left end of a row: every ball gets less than the one before.
pub(super) fn inverse_square_light() -> Shot {
    let centers = wall(8, 1, 1.1);
    let mut shot = Shot::new(centers, 0.45, DVec3::new(0.0, -9.0, 0.0), DVec3::ZERO);
    shot.scene.lights = vec![Light::point_with(
        DVec3::new(-4.5, -1.5, 1.5),
        DVec3::ZERO,
        Vec3::splat(6.0),
        Falloff::InverseSquare,
    )];
    shot
}

/// Red from the left, blue from the right, with highlights.
pub(super) fn directional_lights() -> Shot {
    let centers = wall(5, 2, 1.3);
    let mut shot = Shot::new(centers, 0.6, DVec3::new(0.0, -8.0, 0.0), DVec3::ZERO);
    let light = |x: f32, color: Vec3| {
        Light::directional(Vec3::new(x, 0.5, -0.4), color).expect("a direction")
    };
    let (left, right) = (Vec3::new(1.2, 0.3, 0.2), Vec3::new(0.2, 0.4, 1.2));
    shot.scene.lights = vec![light(1.0, left), light(-1.0, right)];
    *shot.scene.particle_material_mut() = Material { specular: 0.6, shininess: 60.0, ..MATT };
    shot
}

/// All planes, with a far origin so that `P` is seen to be in world units.
pub(super) fn data_channels() -> Shot {
    let origin = DVec3::new(1000.0, -2000.0, 500.0);
    let centers: Vec<Vec3> = wall(7, 4, 1.0).iter().map(|p| *p + Vec3::Y * (0.3 * p.x)).collect();
    let mut shot = Shot::new(centers, 0.5, DVec3::ZERO, DVec3::Y);
    let view = CameraView {
        eye: origin + DVec3::new(1.0, -8.0, 1.5),
        look_at: origin,
        up: DVec3::Z,
        fov: 35.0,
    };
    let aspect = f64::from(WIDTH) / f64::from(HEIGHT);
    shot.scene.camera = Camera::new(&view, aspect, origin).expect("a camera");
    shot.scene.origin = origin;
    shot.scene.ground = Some(floor(-2.0));
    shot.ids = Some((0..28).map(|i| 4_000_000_000 + 7 * i).collect());
    shot.velocities = Some(shot.centers.iter().map(|p| 0.1 * p.cross(Vec3::Y)).collect());
    shot.settings.channels = Channels::ALL;
    let colors: Vec<Vec3> = shot.centers.iter().map(|p| 0.5 + 0.12 * *p).collect();
    shot.painted(&colors)
}

/// The background is left out of colour and coverage; the floor fades out in coverage.
pub(super) fn transparent_background() -> Shot {
    let mut shot = ground();
    shot.scene.background = SUNSET;
    shot.settings.transparent_background = true;
    shot
}

/// A block of balls seen at equal angles to its three sides: all balls have the same size.
pub(super) fn orthographic() -> Shot {
    let side = || (0..4_u8).map(|i| f32::from(i) - 1.5);
    let column = |x: f32| side().flat_map(move |y| side().map(move |z| Vec3::new(x, y, z)));
    let centers: Vec<Vec3> = side().flat_map(column).collect();
    let colors: Vec<Vec3> = centers.iter().map(|p| 0.5 + 0.25 * *p).collect();
    let eye = 10.0 * DVec3::new(1.0, -1.0, 1.0);
    let mut shot = Shot::new(centers, 0.4, eye, DVec3::ZERO);
    shot.project(eye, Projection::Orthographic { height: 8.0 }, None);
    shot.painted(&colors)
}

/// Rings of balls around the eye, above a floor: red ahead, green at the right, blue behind.
pub(super) fn equirectangular() -> Shot {
    let mut centers = Vec::new();
    let mut colors = Vec::new();
    for (i, color) in (0..16_u8).zip([RED, GREY, GREY, GREY, GREEN, GREY, GREY, GREY].repeat(2)) {
        let angle = f32::from(i) * std::f32::consts::TAU / 16.0;
        let level = Vec3::new(angle.sin(), angle.cos(), 0.0);
        for height in [-0.8, 0.0, 2.5] {
            centers.push(3.0 * level + height * Vec3::Z);
            colors.push(if i == 8 { BLUE } else { color });
        }
    }
    let mut shot = Shot::new(centers, 0.4, DVec3::ZERO, DVec3::Y);
    shot.scene.ground = Some(floor(-1.2));
    shot.scene.background = SUNSET;
    shot.project(DVec3::ZERO, Projection::Equirectangular, None);
    shot.painted(&colors)
}

/// Three balls: the middle one is at the distance of the screen, where both eyes see it in the same place.
pub(super) fn stereo() -> Shot {
    let centers =
        vec![Vec3::new(-0.8, -3.0, 0.0), Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.6, 5.0, 0.0)];
    let eye = DVec3::new(0.0, -8.0, 0.0);
    let mut shot = Shot::new(centers, 0.7, eye, DVec3::ZERO);
    let eyes = StereoSettings { eye_distance: Some(1.0), convergence: Convergence::Target };
    shot.project(eye, Projection::Perspective, Some(eyes));
    shot.painted(&[RED, GREEN, BLUE])
}
