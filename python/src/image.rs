//! Renders arrays to images in memory.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use spherule::manifest::{ManifestSource, Override};
use spherule::output::plane_channels;
use spherule::render::FilmPlane;
use spherule::render::planes::{Components, PlaneKind};
use spherule::scene::Projection;
use spherule::still::{self, Particles, StillImage, StillSettings};
use spherule_formats::SimulationCell;

use crate::arrays::{PositionArray, attribute, view};
use crate::errors::{Class, Failure};
use crate::settings::{overrides, raised};
use crate::threads;

/// A finished picture. It never changes, so that arrays may borrow its planes.
#[pyclass(frozen, module = "spherule._spherule")]
pub(crate) struct NativeImage {
    image: StillImage,
}

/// Renders particles; see `spherule.render`, which checks the arguments.
#[pyfunction]
#[pyo3(signature = (positions, attributes, settings, *, base, frame, name, time, cell, threads))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of one Python function")]
pub(crate) fn render(
    py: Python<'_>,
    positions: &Bound<'_, PyAny>,
    attributes: Vec<(String, Bound<'_, PyAny>)>,
    settings: &str,
    base: PathBuf,
    frame: i64,
    name: String,
    time: Option<f64>,
    cell: Option<Cell>,
    threads: Option<usize>,
) -> PyResult<NativeImage> {
    let settings = raised(py, read_settings(settings, base, frame, name))?;
    let positions = PositionArray::new(positions)?;
    let attributes = attributes.into_iter().map(|(name, array)| attribute(name, &array));
    let particles = Particles {
        positions: positions.slice()?,
        attributes: attributes.collect::<PyResult<_>>()?,
        time,
        cell: cell.and_then(simulation_cell),
        ..Particles::default()
    };
    let stop = AtomicBool::new(false);
    let on_signal = || stop.store(true, Ordering::Relaxed);
    let image =
        threads::run(py, threads, on_signal, || Ok(still::render(&settings, particles, &stop)?))?;
    Ok(NativeImage { image })
}

/// A simulation cell: its corner, its edges, and along which of them it repeats.
pub(crate) type Cell = ([f64; 3], [[f64; 3]; 3], [bool; 3]);

/// None for a cell without an extent.
fn simulation_cell((origin, vectors, periodic): Cell) -> Option<SimulationCell> {
    SimulationCell::new(origin.into(), vectors.map(DVec3::from_array), periodic)
}

fn read_settings(
    json: &str,
    base: PathBuf,
    frame: i64,
    name: String,
) -> Result<StillSettings, Failure> {
    let mut all = overrides(json)?;
    let input = Override::new("input.path", name.clone(), "name");
    all.push(input.map_err(|error| Failure::new(Class::Internal, error))?);
    let source = ManifestSource::new("", Path::new("settings"), all);
    Ok(StillSettings { base, frame, name, ..StillSettings::of_source(source)? })
}

#[pymethods]
impl NativeImage {
    #[getter]
    fn width(&self) -> u32 {
        self.image.film().width
    }

    #[getter]
    fn height(&self) -> u32 {
        self.image.film().height
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.image.notes().to_vec()
    }

    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.image.survey().origin.to_array()
    }

    /// Eye, target, direction up, and field of view in degrees; and the height of an orthographic picture.
    #[getter]
    fn view(&self) -> ([f64; 3], [f64; 3], [f64; 3], f64, Option<f64>) {
        let (view, projection) = self.image.view();
        let height = match projection {
            Projection::Orthographic { height } => Some(height),
            Projection::Perspective | Projection::Equirectangular => None,
        };
        let [eye, look_at, up] = [view.eye, view.look_at, view.up].map(|v| v.to_array());
        (eye, look_at, up, view.fov, height)
    }

    /// Smallest and largest value of the colour map, if there is one.
    #[getter]
    fn color_range(&self) -> Option<(f64, f64)> {
        match &self.image.setup().picture.particles.first().color {
            spherule::pipeline::ColorRule::Attribute { map, .. } => {
                map.range().map(|([low, high], _)| (low, high))
            }
            _ => None,
        }
    }

    /// The planes by name, as read-only arrays without a copy. Planes whose number of components depends on the job are
    /// tuples of an array and the names of the components.
    fn planes<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (py, owner) = (slf.py(), slf.as_any());
        let image = &slf.get().image;
        let film = image.film();
        let (width, height) = (film.width as usize, film.height as usize);
        let planes = PyDict::new(py);
        // Colours are always there
        let colors = bytemuck::cast_slice::<[f32; 4], f32>(&film.color);
        planes.set_item("rgba", view(owner, colors, &[height, width, 4])?)?;
        // Others, if they were requested: the denoiser may have needed more
        for plane in FilmPlane::all().filter(|plane| film.channels.has(*plane)) {
            let count = film.channels.components(plane);
            let is_fixed = matches!(plane.components(), Components::One | Components::Named(_));
            let shape = &[height, width, count];
            let shape = if is_fixed && count == 1 { &shape[..2] } else { shape };
            let array = if plane.kind() == PlaneKind::Id {
                view(owner, film.plane::<u32>(plane).unwrap_or_default(), shape)?
            } else {
                view(owner, film.plane::<f32>(plane).unwrap_or_default(), shape)?
            };
            if is_fixed {
                planes.set_item(plane.name(), array)?;
            } else {
                let names = &image.setup().picture.files.exr.names;
                let names = plane_channels(plane, film.channels, names);
                planes.set_item(plane.name(), (array, names))?;
            }
        }
        Ok(planes)
    }

    fn to_exr<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.image.to_exr());
        encoded(py, bytes)
    }

    /// The pixels of the PNG: 8-bit sRGB.
    fn srgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pixels = py
            .detach(|| self.image.to_srgb())
            .map_err(|error| Failure::new(Class::Output, error).raise(py))?;
        let film = self.image.film();
        let shape = [film.height as usize, film.width as usize, pixels.channels];
        let array = PyArray1::from_vec(py, pixels.bytes).reshape(shape)?;
        Ok(array.into_any())
    }

    fn to_png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.image.to_png());
        encoded(py, bytes)
    }
}

fn encoded(
    py: Python<'_>,
    bytes: Result<Vec<u8>, spherule::output::OutputError>,
) -> PyResult<Bound<'_, PyBytes>> {
    let bytes = bytes.map_err(|error| Failure::new(Class::Output, error).raise(py))?;
    Ok(PyBytes::new(py, &bytes))
}
