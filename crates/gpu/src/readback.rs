//! Pictures on their way from the device to the host, with what they have cost.

use wgpu::SubmissionIndex;

use crate::arrays::PendingDownload;
use crate::commands::seconds_of;
use crate::pixels::{Cost, HostPixels};
use crate::{Device, GpuError};

/// Counters of the light that is lost.
pub(crate) const LOST_WORDS: usize = 2;

/// What is known of a picture on the device.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Traced {
    pub(crate) pixels: u64,
    pub(crate) samples: u32,
    pub(crate) sources: u32,
    pub(crate) queues: u32,
    pub(crate) is_denoised: bool,
    pub(crate) has_objects: bool,
    pub(crate) layers: u32,
}

/// What is known of the cost of a picture before it is there.
#[derive(Debug)]
pub(crate) struct KnownCost {
    pub(crate) traced: Traced,
    /// Seconds of stages before those whose times are copied.
    pub(crate) seconds_before: f64,
    /// Memory of the device, and that of the tree, bytes.
    pub(crate) bytes: u64,
    pub(crate) tree_bytes: u64,
}

impl KnownCost {
    /// The whole. `counts`: rays of the queues, then the light that is lost; `seconds` of the build, of the stages, and of
    /// denoising.
    fn complete(self, counts: &[u64], seconds: &[f64]) -> Cost {
        let Traced { pixels, samples, sources, queues, is_denoised, .. } = self.traced;
        let (lengths, lost) = counts.split_at(counts.len() - LOST_WORDS);
        // The first queue of each depth has rays that go on, those of the sources shadow rays
        let of_queue = |queue: u32| -> u64 {
            lengths.iter().skip(queue as usize).step_by(queues as usize).sum()
        };
        let refracted = if queues > 1 + sources { of_queue(1 + sources) } else { 0 };
        // The last stage denoises
        let tracing = seconds.len() - usize::from(is_denoised && !seconds.is_empty());
        Cost {
            build_seconds: seconds.first().copied().unwrap_or_default(),
            trace_seconds: self.seconds_before + seconds[..tracing].iter().skip(1).sum::<f64>(),
            denoise_seconds: seconds[tracing..].iter().sum(),
            primary_rays: pixels * u64::from(samples),
            reflected_rays: of_queue(0) - refracted,
            refracted_rays: refracted,
            shadow_rays: (1..=sources).map(of_queue).sum(),
            lost_steps: lost[0].saturating_add(lost[1].saturating_mul(1 << 32)),
            bytes: self.bytes,
            tree_bytes: self.tree_bytes,
        }
    }
}

/// A picture that the device copies to the host.
#[derive(Debug)]
pub struct PendingPixels {
    pub(crate) content: PendingDownload,
    /// Bytes of its slices, which the counts follow, and then the times.
    pub(crate) lengths: [u64; 5],
    /// Bytes of the counts.
    pub(crate) counts: u64,
    pub(crate) cost: KnownCost,
}

impl PendingPixels {
    /// What the device has done once the picture is there.
    pub(crate) fn submission(&self) -> &SubmissionIndex {
        self.content.submission()
    }

    /// Waits for the picture. Returns its pixels, and what it and its frame have cost.
    ///
    /// # Errors
    /// If the device fails.
    pub fn wait(self, device: &Device) -> Result<(HostPixels, Cost), GpuError> {
        let content = self.content.wait(device)?;
        #[expect(clippy::cast_possible_truncation, reason = "they are in memory")]
        let [pixels, counts] =
            [self.lengths.iter().sum(), self.counts].map(|len: u64| len as usize);
        let (counts, times) = content.bytes()[pixels..].split_at(counts);
        let counts: Vec<u64> = bytemuck::pod_collect_to_vec(counts);
        let cost = self.cost.complete(&counts, &seconds_of(device, times));
        Ok((HostPixels::new(content, self.lengths), cost))
    }
}
