//! Particles near those of a body, of other bodies that it touches.

use glam::Vec3;
use rayon::prelude::*;

use super::field::FieldParticles;

/// Those of `others` within `reach` of any of `centers`, in their order.
pub fn near(centers: &[Vec3], others: &[Vec3], reach: f32) -> Vec<Vec3> {
    if centers.is_empty() || others.is_empty() {
        return Vec::new();
    }
    let field = FieldParticles::sorted(centers, reach, false);
    let bins = field.bins();
    let is_near = |point: &&Vec3| {
        let [x, y, z] = bins.cell_of(**point);
        let rows = (z.saturating_sub(1)..=z.saturating_add(1))
            .flat_map(|z| (y.saturating_sub(1)..=y.saturating_add(1)).map(move |y| (z, y)));
        rows.into_iter().any(|(z, y)| {
            let run = bins.run(z, y, x.saturating_sub(1)..x.saturating_add(2));
            let mut places = bins.particles_in(run);
            places.any(|at| bins.points()[at].distance_squared(**point) <= reach * reach)
        })
    };
    others.par_iter().with_min_len(1 << 10).filter(is_near).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smooth::SmoothGrid;
    use crate::{Shape, Side, SurfaceSettings};
    use spherule_tree::ray::Ray;

    #[test]
    fn particles_within_reach_are_found_in_their_order() {
        let line = |from: u16, to: u16| (from..to).map(|x| Vec3::X * f32::from(x)).collect();
        let (centers, others): (Vec<Vec3>, Vec<Vec3>) = (line(0, 10), line(5, 30));
        assert_eq!(near(&centers, &others, 3.5), others[..8]);
        let moved: Vec<Vec3> = others.iter().map(|point| *point + 4.0 * Vec3::Y).collect();
        assert_eq!(near(&centers, &moved, 3.5), []);
        assert_eq!(near(&[], &others, 3.5), []);
    }

    #[test]
    fn bodies_that_extend_into_each_other_have_no_gap() {
        // A block of particles with a distance of 2 radii, whose halves are two bodies
        let place = |i: u16| {
            let [x, y, z] = [i % 16, i / 16 % 16, i / 256].map(f32::from);
            2.0 * Vec3::new(x, y, z)
        };
        let (low, high): (Vec<Vec3>, Vec<Vec3>) =
            (0..16 * 16 * 16).map(place).partition(|point| point.z < 15.0);
        let settings = SurfaceSettings { smoothing: 0.5, ..SurfaceSettings::DEFAULT };
        let body = |centers: &[Vec3]| {
            let mut grid = SmoothGrid::default();
            grid.build(centers, 1.0, &settings, true, None).unwrap();
            grid
        };
        let extended = [&high[..], &near(&high, &low, 2.0 * settings.support())].concat();
        let [low, high, extended] = [&low, &high, &extended].map(|centers| body(centers));
        let across = (0..400_u16).map(|i| Vec3::new(-0.4, 14.6, 11.0 + 0.02 * f32::from(i)));
        // Each is rounded where it ends
        let is_in = |grid: &SmoothGrid, point| grid.surface().side_of(point) == Side::Inside;
        let gap = |other: &SmoothGrid| {
            across.clone().filter(|point| !is_in(&low, *point) && !is_in(other, *point)).count()
        };
        assert!(gap(&high) > 5, "{}", gap(&high));
        assert_eq!(gap(&extended), 0);
        // Their attributes stay apart
        let mut own = extended;
        own.set_own_particles(16 * 16 * 8);
        let ray = Ray::new(Vec3::new(-9.0, 14.6, 15.5), Vec3::X);
        let hit = own.surface().nearest(&ray).expect("a surface");
        assert!(own.surface().particle_at(&hit) < 16 * 16 * 8);
        own.surface().blend(&hit, &mut |particle, _| assert!(particle < 16 * 16 * 8));
    }
}
