//! Computes the volumes of particles from kernel sums over their neighbours.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::bins::Bins;
use super::kernel::weight;
use spherule_tree::accel::simd::{ArrayLanes, ArrayTask};

/// Particles tested at once.
const LANES: usize = 16;
/// Upper limit of kernel sums, above the number of particles that a fluid has in one place. It bounds the work if all
/// particles coincide, and sums below it are exact.
const MAX_SUM: f32 = 64.0;
/// Terms are rounded to multiples of 2^-18, so that sums up to the limit are exact.
const ROUNDING: f32 = 48.0;
/// Particles tested between two checks of the limit.
const CHECK_LEN: usize = 16 * LANES;
/// A coordinate farther away than any neighbour; its square is finite.
const FAR_AWAY: f32 = 1e18;
/// Rows of bins per task.
const ROWS: usize = 8;

/// The volume of each particle in the bins for which `is_needed` returns true; 0 for all others.
pub(super) fn volumes(bins: &Bins, is_needed: impl Fn(usize) -> bool + Sync) -> Vec<f32> {
    let mut volumes = vec![0.0; bins.points().len()];
    // Split the result into tasks of several rows
    let mut tasks = Vec::new();
    let mut rest = &mut volumes[..];
    for first in (0..bins.row_count()).step_by(ROWS) {
        let rows = first..(first + ROWS).min(bins.row_count());
        let of_rows = bins.bins_in(rows.start).start..bins.bins_in(rows.end - 1).end;
        let particles = bins.particles_in(of_rows);
        let (own_volumes, others) = rest.split_at_mut(particles.len());
        rest = others;
        tasks.push((rows, particles.start, own_volumes));
    }
    // Compute the volumes bin by bin
    let lanes = ArrayLanes::default();
    tasks.into_par_iter().for_each_init(
        Neighbours::default,
        |neighbours, (rows, first, volumes)| {
            for row in rows {
                for bin in bins.bins_in(row).filter(|bin| is_needed(*bin)) {
                    let particles = bins.particles_in(bin..bin + 1);
                    neighbours.gather(bins, row, bin);
                    let own = particles.start - first..particles.end - first;
                    lanes.run(Sum {
                        neighbours,
                        inverse: 1.0 / bins.size(),
                        points: &bins.points()[particles],
                        volumes: &mut volumes[own],
                    });
                }
            }
        },
    );
    volumes
}

/// The particles of a bin and of the 26 bins around it, in groups of lanes.
#[derive(Debug, Default)]
struct Neighbours {
    x: Vec<[f32; LANES]>,
    y: Vec<[f32; LANES]>,
    z: Vec<[f32; LANES]>,
    /// Number of particles in the last group.
    filled: usize,
}

impl Neighbours {
    fn gather(&mut self, bins: &Bins, row: usize, bin: usize) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.filled = LANES;
        let (place, x) = (bins.row(row), bins.bin(bin).x);
        for z in place.z - 1..=place.z + 1 {
            for y in place.y - 1..=place.y + 1 {
                let run = bins.run(z, y, x - 1..x + 2);
                self.extend(bins.points(), bins.particles_in(run));
            }
        }
    }

    fn extend(&mut self, points: &[Vec3], particles: Range<usize>) {
        for point in &points[particles] {
            if self.filled == LANES {
                self.x.push([FAR_AWAY; LANES]);
                self.y.push([FAR_AWAY; LANES]);
                self.z.push([FAR_AWAY; LANES]);
                self.filled = 0;
            }
            let group = self.x.len() - 1;
            self.x[group][self.filled] = point.x;
            self.y[group][self.filled] = point.y;
            self.z[group][self.filled] = point.z;
            self.filled += 1;
        }
    }
}

/// Computes the volumes of the particles of a bin.
struct Sum<'a> {
    neighbours: &'a Neighbours,
    inverse: f32,
    points: &'a [Vec3],
    volumes: &'a mut [f32],
}

impl ArrayTask for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Neighbours { x, y, z, .. } = self.neighbours;
        for (point, volume) in self.points.iter().zip(self.volumes) {
            let mut sums = [0.0_f32; LANES];
            for first in (0..x.len()).step_by(CHECK_LEN / LANES) {
                let groups = first..(first + CHECK_LEN / LANES).min(x.len());
                // Sum the kernel over some groups, in lanes
                for ((x, y), z) in x[groups.clone()].iter().zip(&y[groups.clone()]).zip(&z[groups])
                {
                    for lane in 0..LANES {
                        let (dx, dy, dz) =
                            (x[lane] - point.x, y[lane] - point.y, z[lane] - point.z);
                        let distance = (dx * dx + dy * dy + dz * dz).sqrt();
                        let term = weight(distance * self.inverse);
                        sums[lane] += (term + ROUNDING) - ROUNDING;
                    }
                }
                // Stop if the place is crowded
                if sums.iter().sum::<f32>() >= MAX_SUM {
                    break;
                }
            }
            // The sum includes the particle's own term, which is 1.
            *volume = 1.0 / sums.iter().sum::<f32>().clamp(1.0, MAX_SUM);
        }
    }
}
