//! Converts a source that fits into memory as one part.

use std::sync::Mutex;

use glam::Vec3;
use rayon::prelude::*;

use super::account::MemoryAccount;
use super::batch::{Batch, BufferPool, ParticleRange};
use super::limits::Limits;
use super::order::{OrderedPart, PartData};
use super::output::FrameOutput;
use super::settings::ConvertError;

/// Reads, orders and writes all particles.
pub(super) fn convert(
    output: &mut FrameOutput,
    limits: &Limits,
    account: &MemoryAccount,
) -> Result<(), ConvertError> {
    let part = load(output, limits)?;
    account.hold(part.bytes());
    let mut ordered = OrderedPart::default();
    ordered.order(&part, account);
    output.push(&part, &mut ordered)
}

/// All finite particles in the order of the source.
fn load(output: &mut FrameOutput, limits: &Limits) -> Result<PartData, ConvertError> {
    let (request, columns) = (output.request, output.columns);
    let kept = &output.survey.kept;
    let (count, width) = (output.survey.count, columns.width());
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    // Allocate the particles
    let mut part = PartData { positions: vec![Vec3::ZERO; count], rows: vec![0; count * width] };
    // Give each batch its own range of them
    let (mut positions, mut rows) = (&mut part.positions[..], &mut part.rows[..]);
    let mut places = Vec::with_capacity(kept.len());
    for (number, kept) in (0..).zip(kept) {
        let own;
        (own, positions) = positions.split_at_mut(*kept as usize);
        let own_rows;
        (own_rows, rows) = rows.split_at_mut(own.len() * width);
        places.push((number, own, own_rows));
    }
    let (batches, errors) = (BufferPool::<Batch>::default(), Mutex::new(&mut output.errors));
    // Read the batches in parallel
    places.into_par_iter().try_for_each(|(number, positions, rows)| {
        let mut batch = batches.take();
        let stretch = ParticleRange::nth(number, limits.batch_len, request.source.count());
        batch.read_positions(request.source, request.settings.origin, stretch)?;
        // Check that the source has not changed since the survey
        if batch.positions.len() != positions.len() {
            return Err(request.changed());
        }
        // Store the rows and the errors of the attributes
        let mut own_errors = vec![0.0; columns.attributes.len()];
        batch.read_rows(request.source, columns, stretch, &mut own_errors)?;
        positions.copy_from_slice(&batch.positions);
        rows.copy_from_slice(&batch.rows);
        let mut errors = errors.lock().unwrap_or_else(|e| e.into_inner());
        for (all, own) in errors.iter_mut().zip(own_errors) {
            *all = all.max(own);
        }
        drop(errors);
        batches.put(batch);
        Ok(())
    })?;
    Ok(part)
}
