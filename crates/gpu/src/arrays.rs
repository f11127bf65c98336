//! Memory of the device: arrays that grow, uniforms, and copies from and to the host.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytemuck::Pod;
use rayon::prelude::*;
use wgpu::{
    BindingResource, Buffer, BufferBinding, BufferDescriptor, BufferUsages, BufferView,
    CommandEncoder, MapMode, SubmissionIndex,
};

use crate::{Device, GpuError};

/// Bytes from which an array is copied by all threads.
const MIN_SHARED: usize = 4 << 20;
/// Copies begin at multiples of this number of bytes.
const COPY_STEP: u64 = 16;
/// Distance of uniforms, bytes: no device needs more.
const UNIFORM_STEP: usize = 256;

/// An array on the device. Its memory is kept for the next, unless that is larger.
#[derive(Debug, Default)]
pub(crate) struct Array {
    buffer: Option<Buffer>,
    /// Bytes in use.
    len: u64,
    upload: Upload,
}

/// Memory of the host through which a large array is filled by all threads: a part for each.
#[derive(Debug, Default)]
struct Upload {
    parts: Vec<Buffer>,
    /// Bytes of each part but the last.
    share: u64,
    /// The copies of the last time.
    submission: Option<SubmissionIndex>,
}

impl Upload {
    /// Copies `bytes` to the parts, after the device has read what they held.
    fn copy(&mut self, device: &Device, bytes: &[u8]) -> Result<(), GpuError> {
        let count = rayon::current_num_threads().max(1) as u64;
        let len = bytes.len() as u64;
        let share = len.div_ceil(count).next_multiple_of(COPY_STEP);
        if (self.share, self.parts.len() as u64) == (share, len.div_ceil(share)) {
            for part in &self.parts {
                // The result of the map is that of the wait
                part.map_async(MapMode::Write, .., |_result| ());
            }
            // Not for what was submitted behind them: pictures
            if let Some(submission) = &self.submission {
                device.wait_for(submission)?;
            }
        } else {
            self.parts.clear();
            self.parts.extend((0..len.div_ceil(share)).map(|_| {
                device.raw.create_buffer(&BufferDescriptor {
                    label: Some("upload"),
                    size: share,
                    usage: BufferUsages::MAP_WRITE | BufferUsages::COPY_SRC,
                    mapped_at_creation: true,
                })
            }));
            self.share = share;
            device.check().inspect_err(|_| self.parts.clear())?;
        }
        #[expect(clippy::cast_possible_truncation, reason = "a part of a slice")]
        let pieces = bytes.par_chunks(share as usize);
        pieces.zip(&self.parts).try_for_each(|(piece, part)| {
            part.get_mapped_range_mut(..)
                .map_err(|error| device.lost(&error))?
                .slice(..piece.len())
                .copy_from_slice(piece);
            part.unmap();
            Ok(())
        })
    }
}

impl Array {
    /// Makes room for `len` bytes, at least one element. The content is lost if the array grows.
    ///
    /// # Errors
    /// If that is more than an array of the device may have, or if memory is full. `what` names the content.
    pub(crate) fn reserve(
        &mut self,
        device: &Device,
        what: &'static str,
        len: u64,
    ) -> Result<(), GpuError> {
        let max = device.adapter().max_array.min(device.raw.limits().max_buffer_size);
        if len > max {
            return Err(GpuError::TooLarge { what, bytes: len, max });
        }
        self.len = len;
        let size = len.next_multiple_of(16).max(16);
        if self.buffer.as_ref().is_none_or(|buffer| buffer.size() < size) {
            // Release the old memory before there is more
            self.buffer = None;
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
            self.buffer = Some(device.raw.create_buffer(&BufferDescriptor {
                label: Some(what),
                size,
                usage,
                mapped_at_creation: false,
            }));
            device.check().inspect_err(|_| self.buffer = None)?;
        }
        Ok(())
    }

    /// Replaces the content by `bytes`, which are copied before this returns.
    ///
    /// # Errors
    /// Those of [`Self::reserve`].
    pub(crate) fn write(
        &mut self,
        device: &Device,
        what: &'static str,
        bytes: &[u8],
    ) -> Result<(), GpuError> {
        self.reserve(device, what, bytes.len() as u64)?;
        if bytes.len() < MIN_SHARED {
            if let (Some(buffer), false) = (&self.buffer, bytes.is_empty()) {
                device.queue.write_buffer(buffer, 0, bytes);
            }
            return device.check();
        }
        self.upload.copy(device, bytes)?;
        let mut encoder = device.raw.create_command_encoder(&Default::default());
        for (number, part) in self.upload.parts.iter().enumerate() {
            let at = number as u64 * self.upload.share;
            let len = part.size().min(bytes.len() as u64 - at);
            encoder.copy_buffer_to_buffer(part, 0, self.buffer(), at, len);
        }
        self.upload.submission = Some(device.queue.submit([encoder.finish()]));
        device.check()
    }

    /// The whole array as an argument of a kernel.
    ///
    /// # Panics
    /// If no memory was reserved.
    pub(crate) fn binding(&self) -> BindingResource<'_> {
        self.buffer().as_entire_binding()
    }

    /// # Panics
    /// If no memory was reserved.
    pub(crate) fn buffer(&self) -> &Buffer {
        self.buffer.as_ref().expect("arrays are reserved before kernels use them")
    }

    /// Bytes in use.
    pub(crate) const fn len(&self) -> u64 {
        self.len
    }

    /// Memory of the array, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.buffer.as_ref().map_or(0, Buffer::size)
    }

    /// The content, after all that was submitted.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn read(&self, device: &Device) -> Result<Vec<u8>, GpuError> {
        let download = Downloads::default().reserve(device, self.len)?;
        let mut encoder = device.raw.create_command_encoder(&Default::default());
        download.copy(&mut encoder, self.buffer(), [0, self.len]);
        let submission = device.queue.submit([encoder.finish()]);
        Ok(download.after(submission).wait(device)?.bytes().to_vec())
    }
}

/// Memory through which the host reads arrays. It is kept for the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Downloads(Arc<Mutex<Vec<Buffer>>>);

impl Downloads {
    /// Memory of `len` bytes.
    ///
    /// # Errors
    /// If memory is full.
    pub(crate) fn reserve(&self, device: &Device, len: u64) -> Result<Download, GpuError> {
        let size = len.max(16);
        let mut kept = self.lock();
        kept.retain(|buffer| buffer.size() == size);
        let buffer = kept.pop();
        drop(kept);
        let buffer = buffer.unwrap_or_else(|| {
            device.raw.create_buffer(&BufferDescriptor {
                label: Some("download"),
                size,
                usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
                mapped_at_creation: false,
            })
        });
        device.check()?;
        Ok(Download { buffer, kept: self.clone() })
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Buffer>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Memory that arrays are copied to.
#[derive(Debug)]
pub(crate) struct Download {
    buffer: Buffer,
    kept: Downloads,
}

impl Download {
    /// Copies the first bytes of `source` to `at` here when `encoder` is submitted. `range` is `[at, length]`.
    pub(crate) fn copy(&self, encoder: &mut CommandEncoder, source: &Buffer, [at, len]: [u64; 2]) {
        encoder.copy_buffer_to_buffer(source, 0, &self.buffer, at, len);
    }

    /// The content, once the device has made the copies of a submission.
    pub(crate) fn after(self, submission: SubmissionIndex) -> PendingDownload {
        // The result of the map is that of the wait
        self.buffer.map_async(MapMode::Read, .., |_result| ());
        PendingDownload { download: self, submission }
    }
}

/// Memory that the device has not filled yet.
#[derive(Debug)]
pub(crate) struct PendingDownload {
    download: Download,
    submission: SubmissionIndex,
}

impl PendingDownload {
    /// What the device has done once the content is there.
    pub(crate) fn submission(&self) -> &SubmissionIndex {
        &self.submission
    }

    /// Waits for the device, and returns the content.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn wait(self, device: &Device) -> Result<Downloaded, GpuError> {
        let Self { download, submission } = self;
        device.wait_for(&submission)?;
        let view = download.buffer.get_mapped_range(..).map_err(|error| device.lost(&error))?;
        Ok(Downloaded { view: Some(view), download })
    }
}

/// What was copied, in memory of the host.
#[derive(Debug)]
pub(crate) struct Downloaded {
    /// Until this is dropped.
    view: Option<BufferView>,
    download: Download,
}

impl Downloaded {
    pub(crate) fn bytes(&self) -> &[u8] {
        self.view.as_deref().unwrap_or_default()
    }
}

impl Drop for Downloaded {
    fn drop(&mut self) {
        // The view ends before the memory is given back to the device
        self.view = None;
        let Download { buffer, kept } = &self.download;
        buffer.unmap();
        kept.lock().push(buffer.clone());
    }
}

/// Small structures that kernels read, all in one buffer.
#[derive(Debug, Default)]
pub(crate) struct Uniforms {
    bytes: Vec<u8>,
    buffer: Option<Buffer>,
}

/// Place of a structure in [`Uniforms`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Uniform {
    offset: u64,
    size: u64,
}

impl Uniforms {
    /// Removes all.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Adds a structure.
    pub(crate) fn push<T: Pod>(&mut self, value: &T) -> Uniform {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytemuck::bytes_of(value));
        self.bytes.resize(self.bytes.len().next_multiple_of(UNIFORM_STEP), 0);
        Uniform { offset: offset as u64, size: size_of::<T>() as u64 }
    }

    /// Copies all to the device, before the next submission.
    ///
    /// # Errors
    /// If memory is full.
    pub(crate) fn upload(&mut self, device: &Device) -> Result<(), GpuError> {
        let len = self.bytes.len().max(UNIFORM_STEP) as u64;
        if self.buffer.as_ref().is_none_or(|buffer| buffer.size() < len) {
            self.buffer = Some(device.raw.create_buffer(&BufferDescriptor {
                label: Some("uniforms"),
                size: len,
                usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        if let Some(buffer) = &self.buffer {
            device.queue.write_buffer(buffer, 0, &self.bytes);
        }
        device.check()
    }

    /// A structure as an argument of a kernel.
    ///
    /// # Panics
    /// Before [`Self::upload`].
    pub(crate) fn binding(&self, uniform: Uniform) -> BindingResource<'_> {
        BindingResource::Buffer(BufferBinding {
            buffer: self.buffer.as_ref().expect("uploaded before kernels use them"),
            offset: uniform.offset,
            size: std::num::NonZero::new(uniform.size),
        })
    }
}
