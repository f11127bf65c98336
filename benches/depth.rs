//! How many surface events a ray needs to get through the middle of the thesis's box (figure 6), for each surface.
//!
//! A path takes what is refracted, and what is reflected where nothing is: nearly always the heaviest branch.
//! Told is what part of the paths is past the plane through the box's centre after so many events, and what part
//! has left the box on the far side of that plane. `render.max_depth` is one more, since 1 is the light at the
//! first event.

#![expect(clippy::print_stdout, reason = "a benchmark prints its measurements")]

use glam::Vec3;
use spherule::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
use spherule::ray::Ray;
use spherule::scene::material::{reflect, refract};
use spherule::surface::smooth::SmoothGrid;
use spherule::surface::spheres::SphereSurface;
use spherule::surface::union::UnionSurface;
use spherule::surface::{Intersection, Shape, Side, SurfaceSettings};
use spherule_formats::generate::{BoxSettings, fill_box};

const IOR: f32 = 1.333;
const CENTER: Vec3 = Vec3::new(5.0, 6.5, 0.0);
const VOLUME: f32 = 48.0;
/// What a connected body's spheres are larger by: those of random particles leave gaps otherwise.
const OVERLAPS: [f32; 3] = [1.0, 1.8, 2.5];
/// Rays along a side of the square that is looked through.
const RAYS: u16 = 32;
/// Half the square's edge, at the centre's distance.
const HALF_EDGE: f32 = 0.5;
/// Numbers of events that are printed; longer paths count as lost.
const EVENTS: [usize; 8] = [1, 2, 4, 8, 16, 32, 64, 4096];

/// Events of one path.
#[derive(Clone, Copy)]
struct Events {
    /// Until it passed the plane through the centre; None if it never did.
    to_middle: Option<usize>,
    /// Until it left on the far side; None if it never did.
    to_leave: Option<usize>,
}

fn main() {
    for count in [100_000, 1_000_000] {
        let centers = fill_box(&BoxSettings::thesis(count, 1));
        #[expect(clippy::cast_precision_loss, reason = "a radius needs no more digits")]
        let radius = 0.5 * (VOLUME / count as f32).cbrt();
        let mut builder = TreeBuilder::new();
        let build = |builder: &mut TreeBuilder, larger: f32| {
            let spheres =
                Spheres { centers: &centers, radius: SphereRadius::Common(larger * radius) };
            builder.build(&spheres, &BuildSettings::default());
        };
        build(&mut builder, 1.0);
        let name = format!("{count} particles");
        print_depths(&name, "spheres", &SphereSurface::new(builder.tree().view()));
        for larger in OVERLAPS {
            build(&mut builder, larger);
            let name = format!("{name}, {larger} times the radius");
            print_depths(&name, "union", &UnionSurface::new(builder.tree().view()));
        }
        let mut grid = SmoothGrid::default();
        grid.build(&centers, radius, &SurfaceSettings::DEFAULT, false, None)
            .expect("memory for the surface");
        print_depths(&name, "smooth", &grid.surface());
    }
}

fn print_depths<S: Shape>(of: &str, name: &str, surface: &S) {
    let paths: Vec<Events> = rays().map(|ray| follow(surface, ray)).collect();
    let percent = |events: fn(&Events) -> Option<usize>, most: usize| {
        let within = |path: &&Events| events(path).is_some_and(|needed| needed <= most);
        100.0 * paths.iter().filter(within).count() as f64 / paths.len() as f64
    };
    println!("{name} of {of}");
    for most in EVENTS {
        println!(
            "  {most:5} events: {:5.1} % are past the middle, {:5.1} % are through",
            percent(|path| path.to_middle, most),
            percent(|path| path.to_leave, most),
        );
    }
}

/// From the thesis's eye through a square at the box's centre.
fn rays() -> impl Iterator<Item = Ray> {
    let forward = CENTER.normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let up = right.cross(forward);
    let place = |k: u16| HALF_EDGE * ((f32::from(k) + 0.5) / f32::from(RAYS) * 2.0 - 1.0);
    (0..RAYS * RAYS).map(move |k| {
        let at = CENTER + place(k % RAYS) * right + place(k / RAYS) * up;
        Ray::new(Vec3::ZERO, at.normalize())
    })
}

fn follow<S: Shape>(surface: &S, mut ray: Ray) -> Events {
    let forward = ray.direction;
    let is_beyond = |point: Vec3| (point - CENTER).dot(forward) > 0.0;
    let mut side = Side::Outside;
    let mut found = Events { to_middle: None, to_leave: None };
    for events in 0..=EVENTS[EVENTS.len() - 1] {
        let hit = surface.crossing(&ray, side);
        let is_past = match &hit {
            Some(hit) => is_beyond(hit.point),
            None => ray.direction.dot(forward) > 0.0,
        };
        if is_past && found.to_middle.is_none() {
            found.to_middle = Some(events);
        }
        let Some(hit) = hit else {
            found.to_leave = is_past.then_some(events);
            break;
        };
        (ray, side) = bend(&ray, &hit, side);
    }
    found
}

/// Where a path goes on, and on which side of one body.
fn bend(ray: &Ray, hit: &Intersection, side: Side) -> (Ray, Side) {
    let entering = ray.direction.dot(hit.normal) < 0.0;
    let (normal, ratio) = if entering { (hit.normal, 1.0 / IOR) } else { (-hit.normal, IOR) };
    match refract(ray.direction, normal, ratio) {
        Some(onward) => (Ray::new(hit.anchor - hit.offset * normal, onward), side.other()),
        None => {
            let back = reflect(ray.direction, normal);
            (Ray::new(hit.anchor + hit.offset * normal, back), side)
        }
    }
}
