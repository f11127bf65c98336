//! Fingerprints of the input files of a job.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use crate::{Fingerprint, FrameRequest, JobRequest, Plan};

/// Fingerprints of input files. Each is computed once, even if several frames share the file.
#[derive(Debug, Default)]
pub(crate) struct FingerprintCache {
    known: HashMap<PathBuf, Option<Fingerprint>>,
}

impl FingerprintCache {
    /// Computes the fingerprints of all inputs of `request` that a plan based on `old` needs.
    pub(crate) fn prefetch(request: &JobRequest, selected: &[i64], old: Option<&Plan>) -> Self {
        let mut fingerprints = Self::default();
        let needed = frames_to_fingerprint(request, selected, old);
        for path in needed.iter().flat_map(|frame| frame.dependencies()) {
            fingerprints.get(path);
        }
        fingerprints
    }

    /// The fingerprint of the file at `path`; `None` if it cannot be read.
    pub(crate) fn get(&mut self, path: &Path) -> Option<Fingerprint> {
        if let Some(known) = self.known.get(path) {
            return known.clone();
        }
        let fingerprint = Fingerprint::of_file(path).ok();
        self.known.insert(path.to_owned(), fingerprint.clone());
        fingerprint
    }
}

/// The frames whose inputs are read: the selected ones and those that are new to the plan. A run over a part of
/// a long sequence thus reads only its own inputs.
pub(crate) fn frames_to_fingerprint<'a>(
    request: &'a JobRequest,
    selected: &[i64],
    old: Option<&Plan>,
) -> Vec<&'a FrameRequest> {
    let selected: HashSet<i64> = selected.iter().copied().collect();
    let is_known = |number| old.is_some_and(|plan| plan.frame(number).is_some());
    let frames = request.frames.iter();
    frames.filter(|f| selected.contains(&f.number) || !is_known(f.number)).collect()
}
