use super::*;
use crate::SurfaceKind;
use crate::slices::slice_times;

const RADIUS: f32 = 0.5;
const SLICES: u32 = 4;

fn settings() -> SurfaceSettings {
    SurfaceSettings { kind: SurfaceKind::Smooth, ..SurfaceSettings::DEFAULT }
}

fn exposed<'a>(centers: &'a [Vec3], displacements: &'a [Vec3]) -> ExposedParticles<'a> {
    let support = settings().support() * RADIUS;
    ExposedParticles { centers, displacements, radius: RADIUS, support, slices: SLICES }
}

/// A block that stands still, a drop of three particles before it in the order of the frame, and one of two behind it, with
/// their motion.
fn splash() -> (Vec<Vec3>, Vec<Vec3>) {
    let [fast, other] = [Vec3::new(12.0, 0.0, 6.0), Vec3::new(-5.0, 7.0, 0.0)];
    let drop = [Vec3::ZERO, Vec3::new(0.8, 0.1, 0.0), Vec3::new(0.3, 0.9, 0.2)];
    let mut particles: Vec<(Vec3, Vec3)> =
        drop.iter().map(|offset| (Vec3::new(0.0, 0.0, 14.0) + *offset, fast)).collect();
    for number in 0..5 * 5 * 3 {
        let [x, y, z] = [number % 5, number / 5 % 5, number / 25].map(|place| place as f32);
        particles.push((Vec3::new(x, y, z), Vec3::ZERO));
    }
    particles.extend(drop[..2].iter().map(|offset| (Vec3::new(12.0, 2.0, 6.0) + *offset, other)));
    particles.into_iter().unzip()
}

fn grid(centers: &[Vec3]) -> SmoothGrid {
    let mut grid = SmoothGrid::default();
    grid.build(centers, RADIUS, &settings(), true, None).expect("it fits");
    grid
}

fn moved(centers: &[Vec3], displacements: &[Vec3], time: f32) -> Vec<Vec3> {
    centers.iter().zip(displacements).map(|(center, motion)| *center + time * *motion).collect()
}

fn clumps(particles: &ExposedParticles<'_>) -> MovingClumps {
    let found = FastClumps::of(particles);
    MovingClumps::build(found, particles, &settings(), None).expect("they fit").0
}

/// Numbers from -1 to 1.
fn random(number: u32, dimension: u32) -> f32 {
    2.0 * crate::spray::random(number, dimension) - 1.0
}

/// Rays from all sides through the whole splash, at `time`.
fn rays(number: u32, time: f32) -> RayPacket {
    let mut rays = RayPacket::default();
    for ray in 16 * number..16 * number + 16 {
        let from = Vec3::new(random(ray, 0), random(ray, 1), random(ray, 2));
        let from = 60.0 * from.try_normalize().unwrap_or(Vec3::X);
        let spread = 14.0 * Vec3::new(random(ray, 3), random(ray, 4), random(ray, 5));
        let at = Vec3::new(4.0, 2.0, 7.0) + spread;
        rays.push(&Ray::new(from, (at - from).normalize()));
    }
    rays.time = [time; LANES];
    rays
}

#[test]
fn fast_drops_are_clumps_and_what_touches_slow_water_is_not() {
    let (centers, displacements) = splash();
    let found = FastClumps::of(&exposed(&centers, &displacements));
    let motions: Vec<Vec3> = found.clumps.iter().map(|clump| clump.motion).collect();
    assert_eq!(motions.len(), 2, "{motions:?}");
    assert!(motions[0].distance(displacements[0]) < 1e-5, "{motions:?}");
    assert_eq!(found.sorted_particles(), [0, 1, 2, 78, 79]);
    // Slow particles
    let slow: Vec<Vec3> = displacements.iter().map(|motion| 0.02 * *motion).collect();
    assert!(FastClumps::of(&exposed(&centers, &slow)).is_empty());
    // A drop that bursts
    let mut bursting = displacements.clone();
    bursting[1] = -bursting[0];
    assert_eq!(FastClumps::of(&exposed(&centers, &bursting)).sorted_particles(), [78, 79]);
    // A drop at the block
    let mut touching = centers.clone();
    touching[..3].iter_mut().for_each(|center| center.z -= 10.8);
    assert_eq!(FastClumps::of(&exposed(&touching, &displacements)).sorted_particles(), [78, 79]);
    // One large body that moves as a whole
    let row: Vec<Vec3> = (0..5000_u16).map(|x| Vec3::X * f32::from(x)).collect();
    assert!(FastClumps::of(&exposed(&row, &[Vec3::Y * 9.0; 5000])).is_empty());
}

#[test]
fn rays_see_clumps_where_they_are_at_their_time() {
    let (centers, displacements) = splash();
    let clumps = clumps(&exposed(&centers, &displacements));
    let rest: Vec<Vec3> = clumps.rest().iter().map(|index| centers[*index as usize]).collect();
    let grids: Vec<SmoothGrid> = slice_times(SLICES).map(|_| grid(&rest)).collect();
    let slices = SlicedSurface::new(grids.iter().map(SmoothGrid::surface).collect(), true);
    let surface = SurfaceWithClumps::new(slices, &clumps);
    let (mut found, mut of_clumps, mut wrong) = (0, 0, 0);
    for step in 0..9_u8 {
        // The surface that is built anew for this time
        let time = (f32::from(step) - 4.0) / 8.0;
        let expected = grid(&moved(&centers, &displacements, time));
        for number in 0..600 {
            let all = rays(number, time);
            let (mut own, mut anew) = (all, all);
            let [mut hits, mut expected_hits] = [(); 2].map(|()| Intersections::default());
            surface.intersect(&mut own, Coherence::Incoherent, 0, &mut hits);
            expected.surface().intersect(&mut anew, Coherence::Incoherent, 0, &mut expected_hits);
            assert_eq!(surface.occluded(&all, Coherence::Incoherent, 0xffff), hits.mask);
            for (hit, expected_hit) in hits.all(16).iter().zip(expected_hits.all(16)) {
                match (hit, expected_hit) {
                    (Some(hit), Some(other)) if (hit.t - other.t).abs() < 0.2 * RADIUS => {
                        let particle = surface.particle_at(hit);
                        let nearest = expected.surface().nearest_particle(other.point).unwrap();
                        let center = centers[nearest as usize];
                        found += 1;
                        of_clumps += u32::from(displacements[particle as usize] != Vec3::ZERO);
                        assert!(centers[particle as usize].distance(center) < 3.0 * RADIUS);
                    }
                    (None, None) => {}
                    _ => wrong += 1,
                }
            }
        }
    }
    // Voxels do not move with a clump, so some rays at a silhouette differ
    assert!(of_clumps > 300 && found > of_clumps + 3000, "{found} {of_clumps}");
    assert!(wrong * 100 < found, "{wrong} of {found}");
}

#[test]
fn rays_in_a_clump_leave_it_where_it_ends() {
    let (centers, displacements) = splash();
    let clumps = clumps(&exposed(&centers, &displacements));
    let rest: Vec<Vec3> = clumps.rest().iter().map(|index| centers[*index as usize]).collect();
    let still = grid(&rest);
    let surface = SurfaceWithClumps::new(SlicedSurface::new(vec![still.surface()], true), &clumps);
    for time in [-0.45, -0.1, 0.3, 0.5] {
        for (start, reach) in [(0, 2.5), (78, 2.0), (3 + 37, 6.0)] {
            // From the centre of a particle into all directions
            let center = centers[start] + time * displacements[start];
            assert_eq!(surface.side_of(centers[start]), Side::Inside);
            let mut blended = Vec::new();
            surface.blend_at(center, time, &mut |particle, _| blended.push(particle as usize));
            assert!(blended.contains(&start), "{blended:?}");
            let mut packet = RayPacket::default();
            for ray in 0..16 {
                let direction = Vec3::new(random(ray, 0), random(ray, 1), random(ray, 2));
                packet.push(&Ray::new(center, direction.try_normalize().unwrap_or(Vec3::X)));
            }
            packet.time = [time; LANES];
            let mut hits = Intersections::default();
            surface.intersect(&mut packet, Coherence::Incoherent, 0xffff, &mut hits);
            assert_eq!(hits.mask, 0xffff, "{start} at {time}");
            for hit in hits.all(16).into_iter().flatten() {
                assert!(hit.t > 0.3 * RADIUS && hit.t < reach, "{start} at {time}: {hit:?}");
                assert!(hit.point.distance(center) < reach);
            }
        }
    }
}
