//! NumPy arrays to particles and back.

use glam::{DVec3, Vec3};
use numpy::ndarray::{ArrayView, IxDyn};
use numpy::{
    Element, PyArrayDyn, PyArrayMethods, PyReadonlyArray2, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use spherule_formats::{Attribute, AttributeData, PositionSlice, Positions, with_values};

/// Positions that an array owns; the array cannot be borrowed for writing meanwhile.
pub(crate) enum PositionArray<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

impl<'py> PositionArray<'py> {
    pub(crate) fn new(array: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = array.extract() {
            return Ok(Self::F32(array));
        }
        Ok(Self::F64(array.extract()?))
    }

    /// The positions, which must be contiguous rows of three.
    pub(crate) fn slice(&self) -> PyResult<PositionSlice<'_>> {
        let refused = |_| PyTypeError::new_err("positions: expected contiguous rows of three");
        Ok(match self {
            Self::F32(array) => {
                let numbers = array.as_slice()?;
                PositionSlice::F32(bytemuck::try_cast_slice::<f32, Vec3>(numbers).map_err(refused)?)
            }
            Self::F64(array) => {
                let numbers = array.as_slice()?;
                PositionSlice::F64(
                    bytemuck::try_cast_slice::<f64, DVec3>(numbers).map_err(refused)?,
                )
            }
        })
    }
}

/// A copy of the attribute in `array`: one row of numbers for each particle.
pub(crate) fn attribute(name: String, array: &Bound<'_, PyAny>) -> PyResult<Attribute> {
    macro_rules! try_types {
        ($($number:ty),*) => {
            $(if let Ok(array) = array.extract::<PyReadonlyArrayDyn<'_, $number>>() {
                let components = array.shape().get(1).copied().unwrap_or(1);
                let data = AttributeData::from(array.as_slice()?.to_vec());
                return Ok(Attribute { name, components, data });
            })*
        };
    }
    try_types!(f32, f64, i32, i64, u32, u64, i16, u16, i8, u8);
    Err(PyTypeError::new_err(format!("attribute {name}: its type of numbers is not supported")))
}

/// An array of the numbers of an attribute: one row for each particle if there are several components.
pub(crate) fn numbers<'py>(
    py: Python<'py>,
    data: AttributeData,
    components: usize,
) -> PyResult<Bound<'py, PyAny>> {
    with_values!(data, values => {
        let rows = values.len() / components.max(1);
        let array = numpy::PyArray1::from_vec(py, values);
        match components {
            1 => Ok(array.into_any()),
            _ => Ok(array.reshape([rows, components])?.into_any()),
        }
    })
}

/// An array of positions, one row each.
pub(crate) fn positions(py: Python<'_>, positions: Positions) -> PyResult<Bound<'_, PyAny>> {
    let data = match positions {
        Positions::F32(v) => AttributeData::F32(bytemuck::cast_slice(&v).to_vec()),
        Positions::F64(v) => AttributeData::F64(bytemuck::cast_slice(&v).to_vec()),
    };
    numbers(py, data, 3)
}

/// A read-only array over `numbers`, without a copy. `owner` must own them, and never change or move them.
pub(crate) fn view<'py, T: Element>(
    owner: &Bound<'py, PyAny>,
    numbers: &[T],
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    let view = ArrayView::from_shape(IxDyn(shape), numbers)
        .map_err(|error| PyTypeError::new_err(error.to_string()))?;
    #[expect(unsafe_code, reason = "NumPy cannot express that an array borrows")]
    // SAFETY: the array holds a reference to `owner`, which our caller promises keeps the numbers as they are.
    let array = unsafe { PyArrayDyn::borrow_from_array(&view, owner.clone()) };
    Ok(array.readwrite().make_nonwriteable().as_any().clone())
}
