//! Decoded chunks that are kept for the next range, for conversion.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::file::ObjectKey;
use spherule_frame::ParseError;

/// Data set, index of a frame, number of a band.
type Key = (ObjectKey, Option<u64>, u64);

/// Decoded rows, or the reason why there are none.
type Slot = Arc<OnceLock<Result<Arc<Vec<u8>>, ParseError>>>;

/// Decoded chunks. When they take too much memory, the oldest ones are dropped.
#[derive(Debug)]
pub(super) struct BandCache {
    most_bytes: usize,
    bands: Mutex<Bands>,
}

#[derive(Debug, Default)]
struct Bands {
    slots: HashMap<Key, Slot>,
    /// Decoded ones with their bytes, oldest first.
    order: VecDeque<(Key, usize)>,
    bytes: usize,
}

impl BandCache {
    /// A cache of `most_bytes`. What is in use may take more, and so may the newest rows: the next range needs them.
    pub(super) fn new(most_bytes: usize) -> Self {
        Self { most_bytes, bands: Mutex::default() }
    }

    /// The rows of `key`. Calls `decode`, which may not wait for other threads, if they are not there.
    ///
    /// # Errors
    /// That of `decode`.
    pub(super) fn get(
        &self,
        key: Key,
        decode: impl FnOnce() -> Result<Vec<u8>, ParseError>,
    ) -> Result<Arc<Vec<u8>>, ParseError> {
        let lock = || self.bands.lock().unwrap_or_else(PoisonError::into_inner);
        let slot = Arc::clone(lock().slots.entry(key).or_default());
        let mut is_new = false;
        let rows = slot.get_or_init(|| {
            is_new = true;
            decode().map(Arc::new)
        });
        if is_new {
            let len = rows.as_ref().map_or(0, |rows| rows.len());
            let mut bands = lock();
            bands.order.push_back((key, len));
            bands.bytes += len;
            while bands.bytes > self.most_bytes
                && bands.order.len() > 1
                && let Some((oldest, len)) = bands.order.pop_front()
            {
                bands.slots.remove(&oldest);
                bands.bytes -= len;
            }
        }
        rows.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oldest_bands_go_first() {
        let cache = BandCache::new(10);
        let mut decoded = 0;
        let mut get = |band| {
            let rows = cache.get(((0, 0), None, band), || {
                decoded += 1;
                Ok(vec![0; 4])
            });
            assert_eq!(rows.expect("decoded").len(), 4);
            decoded
        };
        assert_eq!([get(0), get(1), get(0), get(2), get(1), get(0)], [1, 2, 2, 3, 3, 4]);
        // Rows that are larger than the cache are decoded once for all ranges
        let small = BandCache::new(3);
        let mut decoded = 0;
        for _ in 0..2 {
            let rows = small.get(((0, 0), None, 0), || {
                decoded += 1;
                Ok(vec![0; 4])
            });
            rows.expect("decoded");
        }
        assert_eq!(decoded, 1);
        let fault = cache.get(((0, 1), None, 0), || Err(ParseError::malformed(7, "bad")));
        assert!(fault.is_err());
    }
}
