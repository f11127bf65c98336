//! The particles of a mapped file as ranges, for conversion.

use glam::DVec3;

use super::band_cache::BandCache;
use super::table::{Column, ParticleTable};
use super::values::Cache;
use spherule_frame::join::PART;
use spherule_frame::{Labels, ParseError, ScalarType, SimulationCell};
use spherule_readers::ranges::{ParticleRanges, RangeAttribute};

/// Bytes of decoded chunks that are kept, as neighbouring ranges need the same ones.
const CACHE_BYTES: u64 = 48 << 20;
/// The same for files with large chunks. If less than one chunk of each column is kept, chunks are decoded once for
/// every range.
const LARGE_CACHE_BYTES: u64 = 256 << 20;

/// The particles of one time step.
#[derive(Debug)]
pub(super) struct TableRanges {
    table: ParticleTable,
    cache: BandCache,
}

impl TableRanges {
    pub(super) fn new(table: ParticleTable) -> Self {
        let one_of_each = table.chunk_lens().fold(0, u64::saturating_add);
        let most = one_of_each.clamp(CACHE_BYTES, LARGE_CACHE_BYTES);
        Self { table, cache: BandCache::new(usize::try_from(most).unwrap_or(usize::MAX)) }
    }

    const fn cache(&self) -> Cache<'_> {
        Some(&self.cache)
    }
}

impl ParticleRanges for TableRanges {
    fn count(&self) -> u64 {
        self.table.count()
    }

    fn attributes(&self) -> Vec<RangeAttribute> {
        let described = |column: &Column| RangeAttribute {
            name: column.name.clone(),
            components: column.components,
            scalar: column.scalar,
        };
        let part = self.table.is_divided().then(|| RangeAttribute {
            name: PART.to_owned(),
            components: 1,
            scalar: ScalarType::U32,
        });
        let columns = self.table.attributes().iter().map(described);
        columns.chain(part).collect()
    }

    fn time(&self) -> Option<f64> {
        self.table.time()
    }

    fn step(&self) -> Option<i64> {
        self.table.step()
    }

    fn cell(&self) -> Option<SimulationCell> {
        self.table.cell()
    }

    fn notes(&self) -> &[String] {
        self.table.notes()
    }

    fn labels(&self) -> &Labels {
        self.table.labels()
    }

    fn position_len(&self) -> u64 {
        self.table.position_len()
    }

    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), ParseError> {
        let bytes = bytemuck::cast_slice_mut(to);
        self.table.read_positions(self.cache(), first, bytes)?;
        if cfg!(target_endian = "big") {
            for position in to {
                let [x, y, z] = position.to_array().map(|c| f64::from_le_bytes(c.to_ne_bytes()));
                *position = DVec3::new(x, y, z);
            }
        }
        Ok(())
    }

    fn read_values(&self, attribute: usize, first: u64, to: &mut [u8]) -> Result<(), ParseError> {
        match self.table.attributes().get(attribute) {
            Some(column) => {
                let scalar = column.scalar;
                self.table.read(column, self.cache(), first, to, scalar)
            }
            None => {
                self.table.read_parts(first, to);
                Ok(())
            }
        }
    }
}
