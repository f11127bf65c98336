//! Kernels, and lists of dispatches.

use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindingResource, CommandEncoder,
    ComputePassDescriptor, ComputePassTimestampWrites, ComputePipeline, ComputePipelineDescriptor,
    PipelineCompilationOptions, ShaderModule, SubmissionIndex,
};

use crate::arrays::{Array, Download, Downloads};
use crate::{Device, GpuError};

/// Workgroups in a row of a dispatch; devices limit each axis to 65,535.
const ROW: u64 = 32_768;

/// A compiled kernel with the numbers of its bindings.
#[derive(Debug)]
pub(crate) struct Kernel {
    pipeline: ComputePipeline,
    bindings: Vec<u32>,
}

impl Kernel {
    /// The kernel `entry` of `module`, which uses exactly these `bindings`.
    pub(crate) fn new(
        device: &Device,
        module: &ShaderModule,
        entry: &str,
        bindings: &[u32],
    ) -> Self {
        let options = PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..PipelineCompilationOptions::default()
        };
        let pipeline = device.raw.create_compute_pipeline(&ComputePipelineDescriptor {
            label: Some(entry),
            layout: None,
            module,
            entry_point: Some(entry),
            compilation_options: options,
            cache: None,
        });
        Self { pipeline, bindings: bindings.to_vec() }
    }
}

struct Dispatch {
    pipeline: ComputePipeline,
    group: BindGroup,
    groups: [u32; 2],
}

/// Dispatches in the order in which they run; each sees the results of those before it.
pub(crate) struct Commands<'a> {
    device: &'a Device,
    dispatches: Vec<Dispatch>,
    encoder: CommandEncoder,
}

impl<'a> Commands<'a> {
    pub(crate) fn new(device: &'a Device) -> Self {
        let encoder = device.raw.create_command_encoder(&Default::default());
        Self { device, dispatches: Vec::new(), encoder }
    }

    /// Adds a dispatch with at least `invocations`, in workgroups of `size`. `array_of` has the argument for each binding.
    pub(crate) fn add<'b>(
        &mut self,
        kernel: &Kernel,
        array_of: &dyn Fn(u32) -> BindingResource<'b>,
        invocations: u64,
        size: u64,
    ) {
        let groups = invocations.div_ceil(size).max(1);
        let columns = groups.min(ROW);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "arrays are smaller than 2^48 elements"
        )]
        let size = [columns as u32, groups.div_ceil(columns) as u32];
        self.add_groups(kernel, array_of, size);
    }

    /// Adds a dispatch of this number of workgroups in each direction.
    pub(crate) fn add_groups<'b>(
        &mut self,
        kernel: &Kernel,
        array_of: &dyn Fn(u32) -> BindingResource<'b>,
        groups: [u32; 2],
    ) {
        let entries: Vec<_> = (kernel.bindings.iter())
            .map(|&binding| BindGroupEntry { binding, resource: array_of(binding) })
            .collect();
        let group = self.device.raw.create_bind_group(&BindGroupDescriptor {
            label: None,
            layout: &kernel.pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        self.dispatches.push(Dispatch { pipeline: kernel.pipeline.clone(), group, groups });
    }

    /// Ends a stage: the dispatches since the last one, whose time `timer` measures.
    pub(crate) fn end_stage(&mut self, timer: Option<(&Timer, u32)>) {
        let timestamp_writes = timer.map(|(timer, stage)| ComputePassTimestampWrites {
            query_set: &timer.queries,
            beginning_of_pass_write_index: Some(2 * stage),
            end_of_pass_write_index: Some(2 * stage + 1),
        });
        let descriptor = ComputePassDescriptor { label: None, timestamp_writes };
        let mut pass = self.encoder.begin_compute_pass(&descriptor);
        for dispatch in self.dispatches.drain(..) {
            pass.set_pipeline(&dispatch.pipeline);
            pass.set_bind_group(0, &dispatch.group, &[]);
            pass.dispatch_workgroups(dispatch.groups[0], dispatch.groups[1], 1);
        }
    }

    /// Copies the first bytes of `array` to `at` in `download`, after all dispatches. `range` is `[at, length]`.
    pub(crate) fn copy(&mut self, array: &Array, download: &Download, range: [u64; 2]) {
        if !self.dispatches.is_empty() {
            self.end_stage(None);
        }
        download.copy(&mut self.encoder, array.buffer(), range);
    }

    /// Copies the times of the first stages of `timer` to `at` in `download`.
    pub(crate) fn copy_times(&mut self, timer: &Timer, stages: u32, download: &Download, at: u64) {
        let Timer { queries, resolved } = timer;
        self.encoder.resolve_query_set(queries, 0..2 * stages, resolved, 0);
        download.copy(&mut self.encoder, resolved, [at, times_bytes(stages)]);
    }

    /// Starts all on the device.
    pub(crate) fn submit(mut self) -> SubmissionIndex {
        if !self.dispatches.is_empty() {
            self.end_stage(None);
        }
        self.device.queue.submit([self.encoder.finish()])
    }
}

/// Measures the time of stages on the device.
#[derive(Debug)]
pub(crate) struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

impl Timer {
    /// A timer for that many stages; None if the device has no clock.
    pub(crate) fn new(device: &Device, stages: u32) -> Option<Self> {
        device.has_timestamps().then(|| Self {
            queries: device.raw.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count: 2 * stages,
            }),
            resolved: device.raw.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: 16 * u64::from(stages),
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
        })
    }

    /// Seconds of each of the first `stages`, once they have run.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn seconds(&self, device: &Device, stages: u32) -> Result<Vec<f64>, GpuError> {
        let download = Downloads::default().reserve(device, times_bytes(stages))?;
        let mut commands = Commands::new(device);
        commands.copy_times(self, stages, &download, 0);
        let submission = commands.submit();
        Ok(seconds_of(device, download.after(submission).wait(device)?.bytes()))
    }
}

/// Memory of the times of stages, bytes.
pub(crate) const fn times_bytes(stages: u32) -> u64 {
    16 * stages as u64
}

/// Seconds of stages, from the times of their ends.
pub(crate) fn seconds_of(device: &Device, times: &[u8]) -> Vec<f64> {
    let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(times);
    let period = f64::from(device.queue.get_timestamp_period()) * 1e-9;
    ticks.chunks_exact(2).map(|t| t[1].wrapping_sub(t[0]) as f64 * period).collect()
}
