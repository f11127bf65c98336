//! Arrays of the device for the pixels and rays of a picture, and for the tables of its light.

use crate::arrays::Array;
use crate::lighting::Lighting;
use crate::picture::FilmSize;
use crate::{Device, GpuError};

/// The arrays.
#[derive(Debug, Default)]
pub(crate) struct TraceArrays {
    pub(crate) colors: Array,
    pub(crate) points: Array,
    pub(crate) sets: Array,
    /// The film that `sets` belongs to, and the content of `points`.
    pub(crate) sampled: Option<(FilmSize, Vec<[f32; 2]>)>,
    pub(crate) film: Array,
    pub(crate) data: Array,
    pub(crate) queued: Array,
    pub(crate) rays: [Array; 2],
    pub(crate) shadows: [Array; 2],
    pub(crate) sums: Array,
    pub(crate) texels: Array,
    pub(crate) constants: Array,
    pub(crate) detail: Array,
    pub(crate) objects: Array,
    pub(crate) layers: Array,
    pub(crate) kept: Array,
    /// The version of the tables of the environment and of materials that the arrays hold.
    tables: Option<u64>,
}

impl TraceArrays {
    /// No other arrays.
    pub(crate) fn with_colors(colors: Array) -> Self {
        Self { colors, ..Self::default() }
    }

    pub(crate) fn all(&self) -> [&Array; 17] {
        let [rays, other_rays] = &self.rays;
        let [shadows, other_shadows] = &self.shadows;
        [
            &self.colors,
            &self.points,
            &self.sets,
            &self.film,
            &self.data,
            &self.queued,
            rays,
            other_rays,
            shadows,
            other_shadows,
            &self.sums,
            &self.texels,
            &self.constants,
            &self.detail,
            &self.objects,
            &self.layers,
            &self.kept,
        ]
    }

    /// Copies the tables of `lighting`, unless they are there.
    pub(crate) fn write_tables(
        &mut self,
        device: &Device,
        lighting: &Lighting,
    ) -> Result<(), GpuError> {
        let tables = &lighting.tables;
        if self.tables != Some(tables.version) {
            self.tables = None;
            self.texels.write(device, "environment", bytemuck::cast_slice(&tables.texels))?;
            self.constants.write(device, "tables", bytemuck::cast_slice(&tables.constants))?;
            let detail = lighting.environment.as_ref().and_then(|of| of.detail.as_ref());
            let halves = detail.map_or(&[][..], |detail| detail.map.bits());
            // Copies are whole words
            let padded: Vec<u16>;
            let halves = if halves.len().is_multiple_of(2) {
                halves
            } else {
                padded = [halves, &[0]].concat();
                &padded
            };
            let what = "the pixels of the environment (environment.detail)";
            self.detail.write(device, what, bytemuck::cast_slice(halves))?;
            self.tables = Some(tables.version);
        }
        Ok(())
    }
}
