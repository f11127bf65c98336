//! Reads the frames of sequences, and writes native frames.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use glam::DVec3;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use spherule::reading::read_budget;
use spherule_formats::{
    ParticleFrame, PositionSlice, Radius, RawParticles, Sequence, SequenceError, SequenceInput,
    SequenceSettings, choose_origin, find_radius, native,
};

use crate::arrays::{self, PositionArray, attribute};
use crate::errors::{Class, Failure};
use crate::image::Cell;
use crate::settings::raised;
use crate::threads;

/// The frames of a sequence.
#[pyclass(frozen, module = "spherule._spherule")]
pub(crate) struct FrameList {
    sequence: Sequence,
}

#[pymethods]
impl FrameList {
    #[new]
    #[pyo3(signature = (paths, *, follow_links, mesh_points, topology))]
    fn new(
        py: Python<'_>,
        paths: Vec<PathBuf>,
        follow_links: bool,
        mesh_points: bool,
        topology: Option<PathBuf>,
    ) -> PyResult<Self> {
        let settings =
            SequenceSettings { budget: read_budget(None, None), follow_links, mesh_points };
        let paths = SequenceInput::from_paths(paths);
        let sequence = py.detach(|| {
            let mut sequence = Sequence::open_with(&paths, settings)?;
            if let Some(topology) = &topology {
                sequence.add_topology(topology)?;
            }
            Ok::<_, SequenceError>(sequence)
        });
        let sequence = raised(py, sequence)?;
        Ok(Self { sequence })
    }

    #[getter]
    fn numbers(&self) -> Vec<i64> {
        let frames = self.sequence.frames().iter();
        frames.map(|frame| frame.number).collect()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.sequence.notes().to_vec()
    }

    #[getter]
    fn up(&self) -> &'static str {
        if self.sequence.is_y_up() { "y" } else { "z" }
    }

    /// The files of frame `index`.
    fn files(&self, index: usize) -> Vec<PathBuf> {
        let frame = self.sequence.frames().get(index);
        let parts = frame.into_iter().flat_map(|frame| &frame.parts);
        parts.map(|part| part.path.clone()).collect()
    }

    /// Reads frame `index` to a dict.
    fn read<'py>(
        &self,
        py: Python<'py>,
        index: usize,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyDict>> {
        if index >= self.sequence.frames().len() {
            let what = format!("no frame has the index {index}");
            return Err(Failure::new(Class::Input, what).raise(py));
        }
        // Read the frame while other threads of Python continue
        let read = || Ok(self.sequence.load_measured(index)?);
        let loaded = threads::run(py, threads, || {}, read)?;
        let raw = loaded.particles;
        // Find radius and origin as the renderer does
        let dict = PyDict::new(py);
        match find_radius(&raw.attributes) {
            Some(Radius::Common(radius)) => dict.set_item("radius", radius)?,
            Some(Radius::PerParticle(radii)) => {
                dict.set_item("radius", numpy::PyArray1::from_vec(py, radii))?;
            }
            None => dict.set_item("radius", py.None())?,
        }
        let origin = match bounds(|i| raw.positions.get(i), raw.positions.len()) {
            Some((min, max)) => choose_origin(min, max),
            None => DVec3::ZERO,
        };
        dict.set_item("origin", origin.to_array())?;
        dict.set_item("time", raw.time)?;
        dict.set_item("notes", loaded.notes)?;
        // Hand over the cell and the arrays
        let cell = raw.cell.map(|cell| -> Cell {
            let vectors = cell.vectors.map(|vector| vector.to_array());
            (cell.origin.to_array(), vectors, cell.periodic)
        });
        dict.set_item("cell", cell)?;
        dict.set_item("positions", arrays::positions(py, raw.positions)?)?;
        let attributes = PyDict::new(py);
        for attribute in raw.attributes {
            let array = arrays::numbers(py, attribute.data, attribute.components)?;
            attributes.set_item(attribute.name, array)?;
        }
        dict.set_item("attributes", attributes)?;
        Ok(dict)
    }
}

/// Smallest and largest of `count` positions that are finite.
fn bounds(position: impl Fn(usize) -> DVec3, count: usize) -> Option<(DVec3, DVec3)> {
    let finite = (0..count).map(position).filter(|p| p.is_finite());
    finite.fold(None, |found: Option<(DVec3, DVec3)>, p| {
        let (min, max) = found.unwrap_or((p, p));
        Some((min.min(p), max.max(p)))
    })
}

/// Writes a native frame without loss; see `spherule.write_spf`, which checks the arguments.
#[pyfunction]
#[pyo3(signature = (path, positions, attributes, *, radius, time))]
pub(crate) fn write_spf(
    py: Python<'_>,
    path: PathBuf,
    positions: &Bound<'_, PyAny>,
    attributes: Vec<(String, Bound<'_, PyAny>)>,
    radius: Option<f32>,
    time: Option<f64>,
) -> PyResult<()> {
    let positions = PositionArray::new(positions)?;
    let attributes = attributes.into_iter().map(|(name, array)| attribute(name, &array));
    let raw = RawParticles {
        positions: positions.slice()?,
        attributes: attributes.collect::<PyResult<_>>()?,
        time,
        ..RawParticles::default()
    };
    threads::run(py, None, || {}, || write(&path, raw, radius))
}

fn write(
    path: &Path,
    raw: RawParticles<PositionSlice<'_>>,
    radius: Option<f32>,
) -> Result<(), Failure> {
    let found = match raw.positions {
        PositionSlice::F32(v) => bounds(|i| v[i].as_dvec3(), v.len()),
        PositionSlice::F64(v) => bounds(|i| v[i], v.len()),
    };
    let origin = found.map_or(DVec3::ZERO, |(min, max)| choose_origin(min, max));
    let mut frame = ParticleFrame::borrowed(raw, origin).with_positions(Cow::into_owned);
    if let Some(radius) = radius {
        frame.radius = Some(Radius::Common(radius));
    }
    native::write(path, &frame, None).map_err(|error| Failure::new(Class::Output, error))
}
