//! Removes noise from rendered pictures.

use glam::Vec3;
use rayon::prelude::*;
use thiserror::Error;

use crate::math::{SimdLevel, Supported};

mod filter;
mod gather;
mod kernels;
mod settings;
mod tile;

pub use settings::{DenoiseSettings, MAX_PATCH, MAX_SEARCH};

use filter::TileFilter;
use tile::Rectangle;

#[derive(Debug, Clone, Copy)]
pub struct DenoiseInput<'a> {
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub color: &'a [[f32; 4]],
    pub odd: &'a [Vec3],
    pub albedo: &'a [Vec3],
    pub normal: &'a [Vec3],
    pub depth: &'a [f32],
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum DenoiseError {
    #[error("{name} {value} {max}")]
    Radius { name: &'static str, value: u32, max: u32 },
    #[error("{name} {value}")]
    Tolerance { name: &'static str, value: f32 },
    #[error("one sample")]
    OneSample,
    #[error("length")]
    Length,
}

#[derive(Debug, Clone, Copy)]
pub struct Execution { pub simd: SimdLevel, pub tile: [usize; 2] }

pub fn denoise(input: &DenoiseInput<'_>, settings: &DenoiseSettings) -> Result<Vec<Vec3>, DenoiseError> {
    denoise_with(input, settings, &Execution { simd: SimdLevel::best(), tile: [240, 64] })
}

pub fn denoise_with(input: &DenoiseInput<'_>, settings: &DenoiseSettings, execution: &Execution) -> Result<Vec<Vec3>, DenoiseError> {
    settings.validate()?;
    let (width, height) = (input.width as usize, input.height as usize);
    let simd = Supported::or_best(execution.simd);
    let mut filtered = vec![Vec3::ZERO; width * height];
    let columns = width.div_ceil(execution.tile[0]); let tw = width.div_ceil(columns);
    let bands = height.div_ceil(execution.tile[1]); let th = height.div_ceil(bands);
    let mut tiles = Vec::new();
    for (band, rows) in filtered.chunks_mut(width * th).enumerate() {
        let mut pieces: Vec<Vec<&mut [Vec3]>> = Vec::new();
        pieces.resize_with(columns, Vec::new);
        for row in rows.chunks_mut(width) { for (p, c) in pieces.iter_mut().zip(row.chunks_mut(tw)) { p.push(c); } }
        for (column, rows) in pieces.into_iter().enumerate() { if rows.is_empty() { continue; }
            let place = Rectangle { left: column * tw, top: band * th, width: rows[0].len(), height: rows.len() };
            tiles.push((place, rows)); }
    }
    tiles.into_par_iter().for_each_init(|| TileFilter::new(simd, input, settings, tw), |filter, (place, mut rows)| filter.filter(&place, &mut rows));
    Ok(filtered)
}
