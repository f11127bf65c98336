//! Opens devices that pass the self-test.

use crate::device::{Checks, Device};
use crate::{GpuError, self_test};

impl Device {
    /// Opens adapter `index`, as counted by [`crate::adapters`], and tests its arithmetic.
    ///
    /// # Errors
    /// If there is no such adapter, if the driver refuses it, if it is too small, or if it is inexact.
    pub fn open(index: usize, checks: Checks) -> Result<Self, GpuError> {
        let device = Self::connect(index, checks)?;
        let arithmetic = self_test::arithmetic_of(&device)?;
        Ok(device.with_arithmetic(arithmetic))
    }

    /// The first device, or None on a machine without one unless `SPHERULE_GPU` requires it.
    #[cfg(test)]
    pub(crate) fn for_tests() -> Option<Self> {
        match Self::open(0, Checks::On) {
            Ok(device) => Some(device),
            Err(GpuError::NoAdapter) if std::env::var_os("SPHERULE_GPU").is_none() => None,
            Err(error) => panic!("{error}"),
        }
    }
}
