//! Limits of pixels that are much brighter than their neighbours: glints of a sun, and samples of light that few paths
//! find. Weights of a few hundredths would spread such a pixel as a visible square over the window.

use rayon::prelude::*;

use super::DenoiseInput;
use super::gather::{Shares, compared, divisor, is_usable};

/// Limits of a pixel: with fewer than this number of neighbours of its kind, it gives the others at most so many times
/// the light of the last of them. Few pixels are a glint if they are somewhat brighter, several only if they are far
/// brighter; in the corner of a bright surface, a pixel has eight neighbours of its kind.
pub(super) const LIMITS: [(usize, f32); 2] = [(4, 4.0), (8, 8.0)];
/// The most neighbours, and the least factor, of these limits.
const MOST: usize = LIMITS[1].0;
const LEAST: f32 = LIMITS[0].1;
/// Neighbours on each side that a pixel is compared with.
pub(super) const RADIUS: usize = 2;

/// The limit of the components of each pixel in both halves, without albedo; infinite unless a pixel is a glint.
pub(super) fn limits(input: &DenoiseInput<'_>) -> Vec<f32> {
    let (width, height) = (input.width as usize, input.height as usize);
    let shares = Shares::of(input.samples);
    let brightness: Vec<f32> =
        (0..width * height).into_par_iter().map(|i| brightness_of(input, shares, i)).collect();
    let view = input.view();
    let mut limits = vec![f32::INFINITY; brightness.len()];
    let rows = limits.par_chunks_mut(width.max(1)).enumerate();
    rows.for_each(|(y, row)| {
        for (x, limit) in row.iter_mut().enumerate() {
            let around = [(x, width, view[0]), (y, height, view[1])].map(|(at, length, view)| {
                let first = at / view * view;
                let end = (first + view).min(length);
                at.saturating_sub(RADIUS).max(first)..(at + RADIUS + 1).min(end)
            });
            let [columns, rows] = around;
            let neighbours = columns.len() * rows.len() - 1;
            let all = rows.flat_map(|y| &brightness[y * width..][columns.clone()]);
            *limit = limit_of(brightness[y * width + x], neighbours, all);
        }
    });
    limits
}

/// The largest component of both halves, without albedo; 0 if the pixel cannot be filtered.
fn brightness_of(input: &DenoiseInput<'_>, shares: Shares, i: usize) -> f32 {
    let color = compared(&input.color[i], input.depth[i], input.is_transparent);
    let odd = compared(&input.odd[i], input.depth[i], input.is_transparent);
    let (albedo, normal) = (input.albedo[i].to_array(), input.normal[i].to_array());
    if !is_usable(&color, &odd, &albedo, &normal) {
        return 0.0;
    }
    let component = |axis: usize| {
        let even = (color[axis] - odd[axis] * shares.odd) / shares.even;
        even.abs().max(odd[axis].abs()) / divisor(albedo[axis], input.depth[i])
    };
    component(0).max(component(1)).max(component(2))
}

/// The limit of a pixel of this `brightness`, which is one of `all` in its window, with so many `neighbours`.
fn limit_of<'a>(brightness: f32, neighbours: usize, all: impl Iterator<Item = &'a f32>) -> f32 {
    // The largest ones, falling, with the pixel itself
    let mut largest = [0.0_f32; MOST + 1];
    let mut alike = 0;
    for other in all {
        alike += usize::from(other * LEAST >= brightness);
        if alike > MOST {
            return f32::INFINITY;
        }
        let mut rest = *other;
        for place in &mut largest {
            if rest > *place {
                std::mem::swap(place, &mut rest);
            }
        }
    }
    // At the edges of tiny views, there are fewer neighbours
    let limits = LIMITS.map(|(needed, factor)| factor * largest[needed.min(neighbours)]);
    let lower = limits.into_iter().filter(|limit| brightness > *limit);
    lower.fold(f32::INFINITY, f32::min)
}
