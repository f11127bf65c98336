//! Where the camera is at each frame of a sequence. Pure and in f64: the same frame number gives the
//! same view, whichever frames there are beside it.

use thiserror::Error;

use super::{Bounds, CameraView, Framing};

mod curve;
mod keys;
mod turntable;

pub use keys::{CameraKey, KeyedPath};
pub use turntable::Turntable;

/// A view for every frame number.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraPath {
    /// The same view always.
    Still(CameraView),
    /// Around an axis at an even pace.
    Turntable(Turntable),
    /// Through keys.
    Keys(KeyedPath),
}

/// Why keys make no path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum PathError {
    /// There is no key.
    #[error("a path of the camera needs at least one key")]
    NoKeys,
    /// A frame has two keys.
    #[error("two keys have frame {0}; a frame has one view")]
    SameFrame(i64),
    /// Halfway there is no up.
    #[error(
        "up turns upside down from frame {} to frame {}, which leaves open to which side; put a key \
         between them", .0[0], .0[1]
    )]
    OppositeUps([i64; 2]),
}

impl CameraPath {
    /// Around `bounds`, from `framing` at frame 0 by `degrees_per_frame` a frame about its up; see
    /// [`Turntable`].
    pub fn turntable(bounds: &Bounds, framing: &Framing, degrees_per_frame: f64) -> Self {
        Self::Turntable(Turntable::new(bounds, framing, degrees_per_frame))
    }

    /// Through `keys` in the order of their frames; see [`KeyedPath`].
    ///
    /// # Errors
    /// There are no keys, two for one frame, or opposite ups at one and the next.
    pub fn through(keys: Vec<CameraKey>) -> Result<Self, PathError> {
        KeyedPath::new(keys).map(Self::Keys)
    }

    /// The view at `frame`. It may be impossible (up along the view, say): [`super::Camera::new`] tells.
    pub fn view(&self, frame: i64) -> CameraView {
        match self {
            Self::Still(view) => *view,
            Self::Turntable(turntable) => turntable.view(frame),
            Self::Keys(keys) => keys.view(frame),
        }
    }

    /// The view that the path is known by, whichever frames a sequence has: that of frame 0 on a
    /// turntable, of the first key.
    pub fn start(&self) -> CameraView {
        match self {
            Self::Still(view) => *view,
            Self::Turntable(turntable) => turntable.view(0),
            Self::Keys(keys) => keys.keys()[0].view,
        }
    }

    /// What changes on the way, of `eye`, `look_at`, `up` and `fov`; nothing if the camera stands still.
    pub fn moving(&self) -> Vec<&'static str> {
        match self {
            Self::Still(_) => Vec::new(),
            Self::Turntable(turntable) if turntable.turns() => vec!["eye"],
            Self::Turntable(_) => Vec::new(),
            Self::Keys(keys) => keys.moving(),
        }
    }
}
