//! `[surface]`: what a surface is like, beside its kind in `[render]`.

use super::reader::{Field, Section};
use super::write::{Entries, Toml, described};
use crate::surface::{NormalKind, SurfaceKind, SurfaceSettings};

/// Edge of a voxel, in particle radii: finer costs memory with its third power, coarser loses drops.
pub(super) const VOXELS: [f32; 2] = [0.25, 4.0];

/// Smoothing length, in particle radii: below, neighbours do not meet; above, every particle has
/// thousands of them.
pub(super) const SMOOTHING_LENGTHS: [f32; 2] = [1.0, 8.0];

/// Greatest threshold; the field is about 1 inside, and seldom more.
pub(super) const MAX_THRESHOLD: f32 = 4.0;

/// Names of surfaces, as users type them.
const KINDS: &[(SurfaceKind, &str)] = &[
    (SurfaceKind::Spheres, "spheres"),
    (SurfaceKind::Medium, "medium"),
    (SurfaceKind::Smooth, "smooth"),
];

/// Names of normals, as users type them.
const NORMALS: &[(NormalKind, &str)] = &[
    (NormalKind::Auto, "auto"),
    (NormalKind::Sphere, "sphere"),
    (NormalKind::Field, "field"),
    (NormalKind::Pca, "pca"),
];

fn name<T: PartialEq>(value: &T, names: &[(T, &'static str)]) -> &'static str {
    let found = names.iter().find(|(known, _)| known == value);
    found.map_or("", |(_, name)| name)
}

/// Reads the kind of surface in `[render]`.
pub(super) fn kind(render: &mut Section<'_>) -> SurfaceKind {
    let default = SurfaceSettings::DEFAULT.kind;
    render.value("surface", default, |f| f.choice(KINDS))
}

/// Reads `[surface]`; the `kind` comes from `[render]`.
pub(super) fn read(mut section: Section<'_>, kind: SurfaceKind) -> SurfaceSettings {
    let default = SurfaceSettings::DEFAULT;
    let radii = |f: &Field<'_>, [low, high]: [f32; 2]| {
        let what = format!("a number of particle radii from {low} to {high}");
        f.number32(&what, |v| (low..=high).contains(&v))
    };
    let settings = SurfaceSettings {
        kind,
        normals: section.value("normals", default.normals, |f| f.choice(NORMALS)),
        smoothing: section.value("smoothing", default.smoothing, |f| {
            f.number32("a number from 0 to 1", |v| (0.0..=1.0).contains(&v))
        }),
        exact: section.value("exact", default.exact, Field::bool),
        voxel: section.value("voxel", default.voxel, |f| radii(f, VOXELS)),
        smoothing_length: section.value("smoothing_length", default.smoothing_length, |f| {
            radii(f, SMOOTHING_LENGTHS)
        }),
        threshold: section.value("threshold", default.threshold, |f| {
            let what = format!("a number above 0, at most {MAX_THRESHOLD}");
            f.number32(&what, |v| v > 0.0 && v <= MAX_THRESHOLD)
        }),
        spray: section.value("spray", default.spray, Field::bool),
    };
    section.finish();
    settings
}

pub(super) fn entries(settings: &SurfaceSettings, out: &mut Entries) {
    out.section("surface");
    out.put(
        "normals",
        &settings.normals,
        "auto | sphere | field (smooth, not of spheres) | pca (smooth, of spheres)",
    );
    // Images do not depend on what their surface has no use for.
    let smooth = settings.kind == SurfaceKind::Smooth;
    let one_body = settings.kind != SurfaceKind::Spheres;
    out.put(
        "smoothing",
        &settings.smoothing,
        "0 (every particle shows) to 1 (calm water); drops and thin sheets stay",
    );
    if !smooth {
        out.depends_on(None);
    }
    out.put(
        "exact",
        &settings.exact,
        "places and normals from the particles instead of the grid, without smoothing",
    );
    if !smooth {
        out.depends_on(None);
    }
    out.put(
        "voxel",
        &settings.voxel,
        "edge of a voxel in particle radii, as splashsurf's -c",
    );
    if !smooth {
        out.depends_on(None);
    }
    out.put(
        "smoothing_length",
        &settings.smoothing_length,
        "of the kernel, in particle radii, as splashsurf's -l",
    );
    if !one_body {
        out.depends_on(None);
    }
    out.put(
        "threshold",
        &settings.threshold,
        "value of the field at the surface, as splashsurf's -t; larger is thinner",
    );
    if !smooth {
        out.depends_on(None);
    }
    out.put(
        "spray",
        &settings.spray,
        "particles with few neighbours are small white spheres",
    );
    if !one_body {
        out.depends_on(None);
    }
}

impl Toml for SurfaceKind {
    fn toml(&self) -> String {
        name(self, KINDS).toml()
    }
}

impl Toml for NormalKind {
    fn toml(&self) -> String {
        name(self, NORMALS).toml()
    }
}

described!(SurfaceKind, { "enum": super::schema::words(&[], KINDS) });

described!(NormalKind, { "enum": super::schema::words(&[], NORMALS) });
