//! Adapters, and the device on which kernels run.
//!
//! wgpu panics at errors that nobody handles. Here a handler keeps the first one, and [`Device::check`], which follows
//! each wait for the device, returns it.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use wgpu::{
    Adapter, Backends, DeviceDescriptor, DeviceType, Error, Features, Instance, InstanceDescriptor,
    PollType, ShaderModule, ShaderModuleDescriptor, ShaderSource, SubmissionIndex,
};

use crate::GpuError;
use crate::arithmetic::Arithmetic;

/// Storage arrays that one kernel uses.
const STORAGE_ARRAYS: u32 = 17;
/// Memory that the invocations of a workgroup share, bytes: that of the kernel that sorts tiles.
const WORKGROUP_MEMORY: u32 = 26 << 10;
/// Invocations of the largest workgroup.
const INVOCATIONS: u32 = 512;

/// Features that are used where they exist.
const OPTIONAL: Features = Features::TIMESTAMP_QUERY.union(Features::SUBGROUP);

/// What is known of an adapter without opening it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AdapterSummary {
    /// Its name.
    pub name: String,
    /// Name and version of its driver.
    pub driver: String,
    /// Whether it is a program on the CPU.
    pub is_software: bool,
    /// Size of the largest array that kernels can use, bytes.
    pub max_array: u64,
}

/// Whether kernels check their indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Checks {
    /// No checks: the lengths of all arrays follow from the numbers that the kernels are given.
    #[default]
    Off,
    /// An index beyond the end of an array is moved inside: for tests.
    On,
}

/// The adapters of this machine, in the order of the driver.
pub fn adapters() -> Vec<AdapterSummary> {
    found_adapters().iter().map(summary).collect()
}

fn found_adapters() -> Vec<Adapter> {
    let backends = Backends::PRIMARY;
    let descriptor =
        InstanceDescriptor { backends, ..InstanceDescriptor::new_without_display_handle() };
    pollster::block_on(Instance::new(descriptor).enumerate_adapters(backends))
}

fn summary(adapter: &Adapter) -> AdapterSummary {
    let info = adapter.get_info();
    AdapterSummary {
        name: info.name,
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        is_software: info.device_type == DeviceType::Cpu,
        max_array: adapter.limits().max_storage_buffer_binding_size,
    }
}

/// Errors that wgpu reported, and the reason of the loss of the device.
#[derive(Debug, Default)]
struct Faults(Mutex<Option<GpuError>>);

impl Faults {
    fn lock(&self) -> MutexGuard<'_, Option<GpuError>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn keep(&self, fault: GpuError) {
        let mut kept = self.lock();
        // The loss of the device is the reason of all other errors
        if kept.is_none() || matches!(fault, GpuError::Lost { .. }) {
            *kept = Some(fault);
        }
    }
}

/// An open device. Everything that kernels need from it goes through here.
#[derive(Debug)]
pub struct Device {
    pub(crate) raw: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    adapter: AdapterSummary,
    arithmetic: Arithmetic,
    checks: Checks,
    faults: Arc<Faults>,
}

impl Device {
    /// Opens adapter `index`, whose arithmetic is not known yet.
    ///
    /// # Errors
    /// If there is no such adapter, if the driver refuses it, or if it is too small.
    pub(crate) fn connect(index: usize, checks: Checks) -> Result<Self, GpuError> {
        // Find the adapter
        let mut found = found_adapters();
        let count = found.len();
        if count == 0 {
            return Err(GpuError::NoAdapter);
        }
        if index >= count {
            return Err(GpuError::UnknownAdapter { index, count });
        }
        let adapter = found.swap_remove(index);
        check_limits(&adapter)?;
        // Open it with all that it allows
        let name = || adapter.get_info().name;
        let descriptor = DeviceDescriptor {
            required_features: OPTIONAL & adapter.features(),
            required_limits: adapter.limits(),
            ..DeviceDescriptor::default()
        };
        let (raw, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| GpuError::Open { adapter: name(), message: error.to_string() })?;
        // Keep what goes wrong later
        let faults = Arc::new(Faults::default());
        let kept = Arc::clone(&faults);
        raw.on_uncaptured_error(Arc::new(move |error: Error| kept.keep(fault_of(&error))));
        let kept = Arc::clone(&faults);
        let adapter_name = name();
        raw.set_device_lost_callback(move |_reason, reason| {
            let is_known = !reason.is_empty();
            let message = if is_known { reason } else { "the driver gives no reason".to_owned() };
            kept.keep(GpuError::Lost { adapter: adapter_name.clone(), message });
        });
        let arithmetic = Arithmetic::Separate;
        Ok(Self { raw, queue, adapter: summary(&adapter), arithmetic, checks, faults })
    }

    /// Sets what the self-test has found.
    #[must_use]
    pub(crate) fn with_arithmetic(self, arithmetic: Arithmetic) -> Self {
        Self { arithmetic, ..self }
    }

    /// The adapter.
    pub const fn adapter(&self) -> &AdapterSummary {
        &self.adapter
    }

    /// How the device rounds.
    pub const fn arithmetic(&self) -> Arithmetic {
        self.arithmetic
    }

    /// Whether the device measures the time of its stages.
    pub fn has_timestamps(&self) -> bool {
        self.raw.features().contains(Features::TIMESTAMP_QUERY)
    }

    /// Whether invocations that run together can add up numbers.
    pub(crate) fn has_subgroups(&self) -> bool {
        self.raw.features().contains(Features::SUBGROUP)
    }

    /// The same, if 32 to 64 of them do.
    pub(crate) fn has_large_subgroups(&self) -> bool {
        let info = self.raw.adapter_info();
        self.has_subgroups() && info.subgroup_min_size >= 32 && info.subgroup_max_size <= 64
    }

    /// Gives the device up, as if the driver had: for tests.
    pub fn destroy(&self) {
        self.raw.destroy();
    }

    /// The error of a device that has stopped to work.
    pub(crate) fn lost(&self, message: &dyn fmt::Display) -> GpuError {
        GpuError::Lost { adapter: self.adapter.name.clone(), message: message.to_string() }
    }

    /// Waits until the device has done all that was submitted.
    ///
    /// # Errors
    /// Those of [`Self::check`].
    pub(crate) fn wait(&self) -> Result<(), GpuError> {
        let waited = self.raw.poll(PollType::wait_indefinitely());
        self.check()?;
        waited.map(drop).map_err(|error| self.lost(&error))
    }

    /// Waits until the device has done what was submitted up to here; more may follow meanwhile.
    ///
    /// # Errors
    /// If the device is lost.
    pub(crate) fn wait_for(&self, submission: &SubmissionIndex) -> Result<(), GpuError> {
        let submission_index = Some(submission.clone());
        let waited = self.raw.poll(PollType::Wait { submission_index, timeout: None });
        // Other errors are those of who submits
        if let Some(lost @ GpuError::Lost { .. }) = &*self.faults.lock() {
            return Err(lost.clone());
        }
        waited.map(drop).map_err(|error| {
            // What was submitted has failed, and whatever follows will
            let lost = self.lost(&error);
            self.faults.keep(lost.clone());
            lost
        })
    }

    /// The first error since the last call, if there is one. A lost device stays lost.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        let mut kept = self.faults.lock();
        let found = match &*kept {
            Some(GpuError::Lost { .. }) => kept.clone(),
            _ => kept.take(),
        };
        found.map_or(Ok(()), Err)
    }

    /// Compiles a shader.
    #[expect(unsafe_code, reason = "the only way to leave out the checks of indices")]
    pub(crate) fn module(&self, source: &str) -> ShaderModule {
        let descriptor =
            ShaderModuleDescriptor { label: None, source: ShaderSource::Wgsl(source.into()) };
        match self.checks {
            Checks::On => self.raw.create_shader_module(descriptor),
            Checks::Off => {
                let unchecked = wgpu::ShaderRuntimeChecks::unchecked();
                // SAFETY: `create_shader_module_trusted` needs kernels that stay inside their arrays and whose loops
                // end. All indices are below counts that the host passes together with arrays of that length; tests
                // run the same kernels with checks. Loops run over these counts, or over the levels of a tree, which
                // is built on the device from them, with a stack as deep as its levels need.
                unsafe { self.raw.create_shader_module_trusted(descriptor, unchecked) }
            }
        }
    }
}

/// Whether the kernels can run on the adapter.
fn check_limits(adapter: &Adapter) -> Result<(), GpuError> {
    let limits = adapter.limits();
    let needs = [
        (
            "storage arrays in a kernel:",
            limits.max_storage_buffers_per_shader_stage,
            STORAGE_ARRAYS,
        ),
        ("bytes of workgroup memory:", limits.max_compute_workgroup_storage_size, WORKGROUP_MEMORY),
        ("invocations in a workgroup:", limits.max_compute_invocations_per_workgroup, INVOCATIONS),
    ];
    match needs.into_iter().find(|(_, found, needed)| found < needed) {
        None => Ok(()),
        Some((what, found, needed)) => Err(GpuError::Limit {
            adapter: adapter.get_info().name,
            what,
            found: found.into(),
            needed: needed.into(),
        }),
    }
}

fn fault_of(error: &Error) -> GpuError {
    match error {
        Error::OutOfMemory { .. } => GpuError::OutOfMemory,
        Error::Validation { description, .. } | Error::Internal { description, .. } => {
            GpuError::Driver(description.clone())
        }
    }
}
