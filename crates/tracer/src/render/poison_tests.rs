//! Infinite and NaN values do not affect other lanes.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{
    brute::{Ball, Balls},
    integrator::testing::shaded,
    solid::Solid,
    stream::SegmentPacket,
    *,
};
use crate::scene::environment::studio;
use crate::scene::{
    Background, Bounds, Camera, CameraView, EnvironmentAxes, Falloff, Fresnel, Ground, Light,
};
use spherule_surface::spheres::SphereSurface;
use spherule_surface::{Intersection, Intersections, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
use spherule_tree::math::{LANES, lane3, set_lane3};
use spherule_tree::ray::{Ray, RayPacket};

const POISON: [f32; 4] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];

fn scene(transmission: f32) -> Scene {
    let view = CameraView {
        eye: DVec3::new(0.0, -6.0, 2.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 30.0,
    };
    let bounds = Bounds { min: DVec3::splat(-1.0), max: DVec3::ONE };
    let lamp = DVec3::new(3.0, -2.0, 4.0);
    let falloff = Falloff::InverseSquare;
    let axes = EnvironmentAxes::of_view(DVec3::Y, DVec3::Z, 0.0);
    Scene {
        lights: vec![
            Light::directional(Vec3::new(1.0, 0.5, -1.0), Vec3::ONE).unwrap(),
            Light::point_with(lamp, DVec3::ZERO, Vec3::splat(20.0), falloff),
        ],
        materials: Scene::basic_materials(Material {
            transmission,
            fresnel: Fresnel::Exact,
            extinction: Vec3::new(0.3, 0.2, 0.1),
            ..Material::DEFAULT
        }),
        background: Background::default_for(Vec3::Z),
        ground: Some(Ground::under(&bounds, Vec3::Z, DVec3::ZERO)),
        environment: Some(Arc::new(studio(axes, Vec3::ONE))),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).unwrap())
    }
}

/// Camera rays over the whole scene.
fn segments(scene: &Scene) -> SegmentPacket {
    let mut segments = SegmentPacket::default();
    segments.rays.clear();
    for lane in 0..LANES {
        let film = glam::Vec2::new((lane % 4) as f32, (lane / 4) as f32) / 4.0 + 0.12;
        segments.rays.push(&scene.camera.ray(film));
        segments.sample[lane] = u32::try_from(lane).unwrap();
    }
    segments
}

/// All results of a packet except those of `poisoned` lanes, as bits, with coherent and with incoherent rays.
fn left(integrator: &dyn Integrator, segments: &SegmentPacket, poisoned: usize) -> Vec<[u32; 3]> {
    let bits = |v: Vec3| v.to_array().map(f32::to_bits);
    let mut all = Vec::new();
    for depth in [1, 2] {
        let (radiance, next) = shaded(integrator, segments, depth);
        let others = (0..LANES).filter(|lane| *lane != poisoned);
        all.extend(others.map(|lane| bits(lane3(&radiance, lane))));
        for stream in [&next.reflected, &next.refracted] {
            for packet in stream.packets() {
                for (lane, ray) in packet.rays.rays().enumerate() {
                    if packet.sample[lane] as usize != poisoned {
                        let throughput = lane3(&packet.throughput, lane);
                        all.extend([ray.origin, ray.direction, throughput].map(bits));
                    }
                }
            }
        }
    }
    all
}

fn check(shape: &dyn Shape, transmission: f32) {
    let scene = scene(transmission);
    let source = ParticleShading::constant(Vec3::new(0.2, 0.5, 0.8));
    let settings = RenderSettings::new(4, 4);
    let plane = scene.ground.as_ref().map(Ground::shape);
    let mut shapes: Vec<&dyn Shape> = plane.iter().map(|plane| plane as &dyn Shape).collect();
    shapes.push(shape);
    let context = || RenderContext::new(shapes.clone(), &scene, &source, &settings);
    check_integrator(&WhittedIntegrator::new(context()), &scene);
    check_integrator(&PathIntegrator::new(context()), &scene);
}

fn check_integrator(integrator: &dyn Integrator, scene: &Scene) {
    let clean = segments(scene);
    assert!(left(integrator, &clean, 0).len() > 40, "there is something to see");
    for lane in [0, 5, 6, 15] {
        let expected = left(integrator, &clean, lane);
        for poison in POISON {
            let bad = Vec3::new(1.0, poison, -0.5);
            let mut poisoned = [clean.clone(), clean.clone(), clean.clone()];
            set_lane3(&mut poisoned[0].rays.origin, lane, bad);
            set_lane3(&mut poisoned[1].rays.direction, lane, bad);
            set_lane3(&mut poisoned[2].throughput, lane, bad);
            for segments in poisoned {
                assert_eq!(left(integrator, &segments, lane), expected, "{lane} {poison}");
            }
        }
    }
}

fn heap() -> Vec<Ball> {
    let ball = |i: u16| Ball {
        center: Vec3::new(f32::from(i % 5) - 2.0, f32::from(i / 5) - 2.0, 0.1 * f32::from(i % 7)),
        radius: 0.6,
    };
    (0..25).map(ball).collect()
}

#[test]
fn nan_rays_do_not_affect_other_rays() {
    let centers: Vec<Vec3> = heap().iter().map(|ball| ball.center).collect();
    let mut builder = TreeBuilder::new();
    let (centers, radius) = (&centers[..], SphereRadius::Common(0.6));
    builder.build(&Spheres { centers, radius }, &BuildSettings::default());
    let spheres = SphereSurface::new(builder.tree().view());
    for transmission in [0.0, 0.8] {
        check(&spheres, transmission);
        check(&Solid::ball(1.0), transmission);
    }
}

/// A shape with NaN values at the intersection of one lane.
struct Poisoned<'a> {
    shape: &'a dyn Shape,
    lane: usize,
    poison: f32,
}

impl Shape for Poisoned<'_> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        self.shape.crossing(ray, side)
    }

    fn is_connected(&self) -> bool {
        self.shape.is_connected()
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        self.shape.intersect(rays, coherence, inside, hits);
        let bad = Vec3::new(0.3, self.poison, 1.0);
        if hits.mask >> self.lane & 1 == 1 {
            hits.t[self.lane] = self.poison;
            hits.offset[self.lane] = self.poison;
            hits.lift[self.lane] = self.poison;
            hits.radius[self.lane] = self.poison;
            set_lane3(&mut hits.point, self.lane, bad);
            set_lane3(&mut hits.anchor, self.lane, bad);
            set_lane3(&mut hits.normal, self.lane, bad);
            set_lane3(&mut hits.shading_normal, self.lane, bad);
        }
    }
}

#[test]
fn nan_particles_do_not_affect_other_particles() {
    let (balls, solid) = (Balls(heap()), Solid::ball(1.0));
    let shapes: [&dyn Shape; 2] = [&balls, &solid];
    for (shape, transmission) in shapes.into_iter().flat_map(|s| [(s, 0.0), (s, 0.8)]) {
        let scene = scene(transmission);
        let source = ParticleShading::constant(Vec3::new(0.2, 0.5, 0.8));
        let settings = RenderSettings::new(4, 4);
        let clean = segments(&scene);
        let of = |shape: &dyn Shape, lane: usize| {
            let integrator =
                WhittedIntegrator::new(RenderContext::new(vec![shape], &scene, &source, &settings));
            left(&integrator, &clean, lane)
        };
        for (lane, poison) in [5, 6, 9].into_iter().flat_map(|l| POISON.map(|p| (l, p))) {
            let poisoned = Poisoned { shape, lane, poison };
            assert_eq!(of(&poisoned, lane), of(shape, lane), "{lane} {poison}");
        }
    }
}
