//! The camera at each frame of a sequence. A pure function in f64: a frame number always gives the same view,
//! whatever other frames exist.

use glam::DVec3;
use thiserror::Error;

use super::{CameraView, Framed, Framing};

mod curve;
mod keys;
mod turntable;

pub use keys::{CameraKey, KeyedPath};
pub use turntable::Turntable;

/// A view for every frame number.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraPath {
    /// The same view for all frames.
    Still(CameraView),
    /// A rotation about an axis at constant speed.
    Turntable(Turntable),
    /// An interpolation of key views.
    Keys(KeyedPath),
}

/// Reasons why keys do not define a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum PathError {
    /// There are no keys.
    #[error("a path of the camera needs at least one key")]
    NoKeys,
    /// Two keys have the same frame.
    #[error("two keys have frame {0}; a frame has one view")]
    SameFrame(i64),
    /// The up vectors of two consecutive keys are opposite, so there is none halfway.
    #[error(
        "up turns upside down from frame {} to frame {}, which leaves open to which side; put a key \
         between them", .0[0], .0[1]
    )]
    OppositeUps([i64; 2]),
}

impl CameraPath {
    /// A rotation around `framed`, with `framing` at frame 0 and by `degrees_per_frame` per frame about its up
    /// vector; see [`Turntable`].
    pub fn turntable(framed: &Framed, framing: &Framing, degrees_per_frame: f64) -> Self {
        Self::Turntable(Turntable::new(framed, framing, degrees_per_frame))
    }

    /// The same for orthographic images, with their height in scene units.
    pub fn parallel_turntable(
        framed: &Framed,
        framing: &Framing,
        degrees_per_frame: f64,
    ) -> (Self, f64) {
        let (turntable, height) = Turntable::parallel(framed, framing, degrees_per_frame);
        (Self::Turntable(turntable), height)
    }

    /// An interpolation of `keys`, sorted by frame; see [`KeyedPath`].
    ///
    /// # Errors
    /// There are no keys, two keys for one frame, or opposite up vectors at consecutive keys.
    pub fn through(keys: Vec<CameraKey>) -> Result<Self, PathError> {
        KeyedPath::new(keys).map(Self::Keys)
    }

    /// The same path with pictures that are enlarged by `factor` around their middle. Keys have fields of view of their
    /// own.
    #[must_use]
    pub fn zoomed(self, factor: f64) -> Self {
        let narrowed = |fov: f64| {
            let half = libm::tan(0.5 * fov.to_radians()) / factor;
            2.0 * libm::atan(half).to_degrees()
        };
        match self {
            // The identity would be rounded
            path if factor == 1.0 => path,
            Self::Still(view) => Self::Still(CameraView { fov: narrowed(view.fov), ..view }),
            Self::Turntable(turntable) => Self::Turntable(turntable.with_fov(narrowed)),
            Self::Keys(keys) => Self::Keys(keys),
        }
    }

    /// The same path with `center` in the middle of the picture, if the camera stands still.
    #[must_use]
    pub fn centered(self, center: DVec3) -> Self {
        match self {
            Self::Still(view) => Self::Still(CameraView {
                eye: view.eye + (center - view.look_at),
                look_at: center,
                ..view
            }),
            path => path,
        }
    }

    /// The view at `frame`. It may be invalid (up parallel to the view, for example), which [`super::Camera::new`]
    /// reports.
    pub fn view(&self, frame: i64) -> CameraView {
        self.view_between(frame, 0.0)
    }

    /// The view `after` frames after `frame`; `after` is a fraction of a frame, or negative.
    pub fn view_between(&self, frame: i64, after: f64) -> CameraView {
        match self {
            Self::Still(view) => *view,
            Self::Turntable(turntable) => turntable.view(frame, after),
            Self::Keys(keys) => keys.view(frame, after),
        }
    }

    /// The first view of the path, whatever frames a sequence has: that of frame 0 on a turntable, or that of the
    /// first key.
    pub fn start(&self) -> CameraView {
        match self {
            Self::Still(view) => *view,
            Self::Turntable(turntable) => turntable.view(0, 0.0),
            Self::Keys(keys) => keys.keys()[0].view,
        }
    }

    /// The parameters that vary along the path, of `eye`, `look_at`, `up` and `fov`; empty for a fixed camera.
    pub fn moving(&self) -> Vec<&'static str> {
        match self {
            Self::Still(_) => Vec::new(),
            Self::Turntable(turntable) if turntable.turns() => vec!["eye"],
            Self::Turntable(_) => Vec::new(),
            Self::Keys(keys) => keys.moving(),
        }
    }
}
