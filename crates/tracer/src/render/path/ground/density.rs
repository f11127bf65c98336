//! Estimates the density of photons on the ground from counts in cells: each point gets the narrowest of several tent
//! filters that contains enough photons, so that sharp caustics stay sharp and sparse photons do not become spots.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use rayon::prelude::*;

use super::{Map, Square, corners};

/// Cells along an edge of the map.
const SIDE: usize = 1024;

/// Number of filters; each is twice as wide as the one before.
const LEVELS: usize = 6;

/// Photons in a cell of a filter, as expected from the next wider filter, that are enough to use it alone; a filter
/// extends over four cells.
const ENOUGH: f32 = 6.0;

/// Photons in a cell for which a filter is not used at all.
const TOO_FEW: f32 = 3.0;

/// Memory for the cells of all filters and the map.
pub(super) const BYTES: u64 =
    (SIDE * SIDE * (size_of::<[f32; 4]>() * 4 / 3 + size_of::<Vec3>())) as u64;

/// The part of it that is untouched, and needs no memory, as long as there are no photons: the finest cells.
pub(super) const CELL_BYTES: u64 = (SIDE * SIDE * size_of::<[f32; 4]>()) as u64;

/// Memory of the map.
pub(super) const MAP_BYTES: u64 = (SIDE * SIDE * size_of::<Vec3>()) as u64;

/// Flux and number of the photons in each cell.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    side: usize,
    /// Linear RGB, and the count.
    cells: Vec<[f32; 4]>,
}

impl Cells {
    pub(super) fn new() -> Self {
        Self { side: SIDE, cells: vec![[0.0; 4]; SIDE * SIDE] }
    }

    /// Adds a photon with `flux` at a position, unless that is outside the square.
    pub(super) fn add(&mut self, position: [f32; 2], flux: Vec3) {
        if !position.iter().all(|p| (0.0..1.0).contains(p)) {
            return;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "inside the square"
        )]
        let [x, y] = position.map(|p| ((p * self.side as f32) as usize).min(self.side - 1));
        let cell = &mut self.cells[y * self.side + x];
        for (sum, part) in cell.iter_mut().zip([flux.x, flux.y, flux.z, 1.0]) {
            *sum += part;
        }
    }

    /// The sums of each square of four cells.
    fn halved(&self) -> Self {
        let side = self.side / 2;
        let sum = |row: usize, column: usize| {
            let first = 2 * row * self.side + 2 * column;
            let parts = [first, first + 1, first + self.side, first + self.side + 1];
            let mut sum = [0.0; 4];
            for part in parts {
                for (sum, value) in sum.iter_mut().zip(self.cells[part]) {
                    *sum += value;
                }
            }
            sum
        };
        let rows = (0..side).into_par_iter();
        let cells = rows.flat_map_iter(|row| (0..side).map(move |column| sum(row, column)));
        Self { side, cells: cells.collect() }
    }

    /// Flux and count of a cell, interpolated at a position.
    fn at(&self, position: [f32; 2]) -> [f32; 4] {
        let mut sum = [0.0; 4];
        for (cell, weight) in corners(self.side, position) {
            for (sum, value) in sum.iter_mut().zip(self.cells[cell]) {
                *sum += weight * value;
            }
        }
        sum
    }

    /// The radiance of a white ground.
    pub(super) fn radiance(self, square: &Square) -> Map {
        let mut levels = vec![self];
        while levels.len() < LEVELS {
            levels.extend(levels.last().map(Self::halved));
        }
        let edge = square.edge / SIDE as f32;
        let center = |cell: usize| (cell as f32 + 0.5) / SIDE as f32;
        let rows = (0..SIDE).into_par_iter();
        let texels = rows.flat_map_iter(|y| {
            let levels = &levels;
            (0..SIDE)
                .map(move |x| density(levels, [center(x), center(y)]) * (FRAC_1_PI / (edge * edge)))
        });
        Map { side: SIDE, texels: texels.collect() }
    }
}

/// Flux in an area of a cell of the first of `levels` at a position, from wide to narrow filters. Whether a filter is
/// used depends on the photons in the next wider one: its own count would prefer those that contain many by chance, and
/// the light would grow.
fn density(levels: &[Cells], position: [f32; 2]) -> Vec3 {
    let (mut density, mut expected) = (Vec3::ZERO, f32::INFINITY);
    for level in levels.iter().rev() {
        let part = ((expected - TOO_FEW) / (ENOUGH - TOO_FEW)).clamp(0.0, 1.0);
        if part <= 0.0 {
            break;
        }
        let [r, g, b, count] = level.at(position);
        let cell = level.side as f32 / SIDE as f32;
        let flux = cell * cell * Vec3::new(r, g, b);
        density = density.lerp(flux, part);
        expected = 0.25 * count;
    }
    density
}
