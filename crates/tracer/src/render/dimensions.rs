//! Numbers of the continuations of a path, and of the random numbers at its vertices.

/// Continuations of a path.
pub(super) const REFLECTED: u32 = 0;
pub(super) const REFRACTED: u32 = 1;
pub(super) const BOUNCED: u32 = 2;
/// Not a continuation: the seed of the random numbers of the camera ray itself.
pub(super) const CAMERA: u32 = 3;
/// The continuation after a scattering event in a medium.
pub(super) const SCATTERED: u32 = 4;

/// Dimensions of a path at one vertex: the choice between specular rays, the continuation of a long path, the
/// direction of a diffuse reflection, the microfacet of a rough interface or the direction of scattered light, and a
/// direction towards the environment.
/// Those of lights follow.
pub(super) const BRANCH: u32 = 0;
pub(super) const CONTINUATION: u32 = 1;
pub(super) const BSDF: u32 = 2;
pub(super) const ENVIRONMENT: u32 = 3;
pub(super) const LIGHTS: u32 = 4;

/// Dimension of a path segment: the choice between passing panes and being reflected. It is beyond those of lights.
pub(super) const PANE: u32 = u32::MAX;
/// Dimension of a path segment: where it ends in soft spray.
pub(super) const SPRAY: u32 = u32::MAX - 1;
/// Dimension of a point of wet ground: the direction of its reflection.
pub(super) const WET: u32 = u32::MAX - 2;
/// Dimension of a path segment: at which sphere that is not fully opaque it ends.
pub(super) const OPACITY: u32 = u32::MAX - 3;
/// Dimension of a path segment: the colour channel by which its free path in media is sampled, and the length of that.
/// It is beyond those of lights, and far below those of translucent spheres.
pub(super) const FREE_PATH: u32 = u32::MAX / 2;
/// Dimensions of a camera ray: its point on the lens, and its time.
pub(super) const LENS: u32 = 0;
pub(super) const TIME: u32 = 1;
