//! Interpolation of key views.

use glam::DVec3;

use super::PathError;
use super::curve::{cubic, slope};
use crate::scene::CameraView;

/// Minimum length of an interpolated up vector; for shorter ones, rounding determines the direction.
const MIN_UP: f64 = 1e-9;

/// The view at a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraKey {
    /// The frame.
    pub frame: i64,
    /// The view.
    pub view: CameraView,
}

/// A path through keys, which it reaches exactly.
///
/// Each coordinate of eye, look_at and up, and the field of view, is interpolated separately: a monotone cubic over
/// the frame number that never leaves the range of the two adjacent keys, with continuous slopes at the keys. Before
/// the first key and after the last one, the camera does not move; it starts and stops smoothly. Up is normalised, or
/// zero if it would pass through zero.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyedPath {
    /// At least one key; ascending frames, normalised up vectors.
    keys: Vec<CameraKey>,
}

impl KeyedPath {
    pub(super) fn new(mut keys: Vec<CameraKey>) -> Result<Self, PathError> {
        if keys.is_empty() {
            return Err(PathError::NoKeys);
        }
        // Check that frames are unique
        keys.sort_by_key(|key| key.frame);
        let same = keys.windows(2).find(|pair| pair[0].frame == pair[1].frame);
        if let Some(pair) = same {
            return Err(PathError::SameFrame(pair[0].frame));
        }
        // Normalise the up vectors, and reject opposite ones
        for key in &mut keys {
            key.view.up = key.view.up.normalize_or_zero();
        }
        let is_opposite = |pair: &&[CameraKey]| {
            let [a, b] = [pair[0].view.up, pair[1].view.up];
            a != DVec3::ZERO && (a + b).length() < MIN_UP
        };
        if let Some(pair) = keys.windows(2).find(is_opposite) {
            return Err(PathError::OppositeUps([pair[0].frame, pair[1].frame]));
        }
        Ok(Self { keys })
    }

    /// The keys, with ascending frames.
    pub fn keys(&self) -> &[CameraKey] {
        &self.keys
    }

    /// Frames of the keys before and after `frame`; None at a key, before the first key and after the last one.
    pub fn around(&self, frame: i64) -> Option<[i64; 2]> {
        let next = self.find(frame).err()?;
        let from = self.keys.get(next.checked_sub(1)?)?;
        Some([from.frame, self.keys.get(next)?.frame])
    }

    /// The view `after` frames after `frame`.
    pub(super) fn view(&self, frame: i64, after: f64) -> CameraView {
        // Divide the time into a frame and a fraction of the time to the next one
        let whole = after.floor();
        #[expect(clippy::cast_possible_truncation, reason = "the conversion saturates")]
        let frame = frame.saturating_add(whole as i64);
        let part = after - whole;
        match self.find(frame) {
            Ok(at) if part == 0.0 || at + 1 == self.keys.len() => self.keys[at].view,
            Ok(at) => Segment::new(&self.keys, at).view(frame, part),
            Err(0) => self.keys[0].view,
            Err(end) if end == self.keys.len() => self.keys[end - 1].view,
            Err(next) => Segment::new(&self.keys, next - 1).view(frame, part),
        }
    }

    /// Index of the key of `frame`, or of the first key after it.
    fn find(&self, frame: i64) -> Result<usize, usize> {
        self.keys.binary_search_by_key(&frame, |key| key.frame)
    }

    pub(super) fn moving(&self) -> Vec<&'static str> {
        let first = self.keys[0].view;
        let differs = |is_other: fn(&CameraView, &CameraView) -> bool| {
            self.keys.iter().any(|key| is_other(&key.view, &first))
        };
        let parts = [
            ("eye", differs(|a, b| a.eye != b.eye)),
            ("look_at", differs(|a, b| a.look_at != b.look_at)),
            ("up", differs(|a, b| a.up != b.up)),
            ("fov", differs(|a, b| a.fov != b.fov)),
        ];
        let moving = parts.into_iter().filter(|(_, moves)| *moves);
        moving.map(|(name, _)| name).collect()
    }
}

/// The segment between two keys, with the keys before and after it if there are any.
struct Segment<'a> {
    from: &'a CameraKey,
    to: &'a CameraKey,
    before: Option<&'a CameraKey>,
    after: Option<&'a CameraKey>,
}

impl<'a> Segment<'a> {
    /// The segment after the key at `index`, which is not the last one.
    fn new(keys: &'a [CameraKey], index: usize) -> Self {
        Self {
            from: &keys[index],
            to: &keys[index + 1],
            before: index.checked_sub(1).map(|before| &keys[before]),
            after: keys.get(index + 2),
        }
    }

    /// The view a `part` of a frame after `frame`.
    fn view(&self, frame: i64, part: f64) -> CameraView {
        let since = gap(self.from.frame, frame) + part;
        let t = since / gap(self.from.frame, self.to.frame);
        let point = |of: fn(&CameraView) -> DVec3| {
            DVec3::new(
                self.value(t, |view| of(view).x),
                self.value(t, |view| of(view).y),
                self.value(t, |view| of(view).z),
            )
        };
        let up = point(|view| view.up);
        CameraView {
            eye: point(|view| view.eye),
            look_at: point(|view| view.look_at),
            up: if up.length() < MIN_UP { DVec3::ZERO } else { up.normalize_or_zero() },
            fov: self.value(t, |view| view.fov),
        }
    }

    /// One coordinate of the view at `t` in 0..1 of the segment.
    fn value(&self, t: f64, of: impl Fn(&CameraView) -> f64) -> f64 {
        let line = |a: &CameraKey, b: &CameraKey| {
            let length = gap(a.frame, b.frame);
            ((of(&b.view) - of(&a.view)) / length, length)
        };
        let (here, length) = line(self.from, self.to);
        // The camera does not move beyond the ends.
        let start = self.before.map_or(0.0, |key| {
            let (before, gap) = line(key, self.from);
            slope(before, here, [gap, length])
        });
        let end = self.after.map_or(0.0, |key| {
            let (after, gap) = line(self.to, key);
            slope(here, after, [length, gap])
        });
        let ends = [of(&self.from.view), of(&self.to.view)];
        cubic(ends, [start * length, end * length], t)
    }
}

/// Number of frames from `a` to `b`, which is not before `a`.
#[expect(clippy::cast_precision_loss, reason = "beyond 2^53 frames a frame more is no other place")]
const fn gap(a: i64, b: i64) -> f64 {
    a.abs_diff(b) as f64
}

#[cfg(test)]
#[path = "keys_tests.rs"]
mod tests;
