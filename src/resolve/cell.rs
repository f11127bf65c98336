//! The simulation cell.

use crate::math::narrow;
use glam::{DVec3, Vec3};
use spherule_formats::SimulationCell;

use super::rods::look;
use crate::manifest::{ColorSetting, Manifest};
use crate::pipeline::RodLook;
use crate::scene::Scene;
use crate::survey::Survey;

/// Automatic radius of the edges as a fraction of the diagonal of the cell: lines 3 pixels wide in a picture 1000
/// pixels high.
const RADIUS: f64 = 0.0015;

/// How the cell is drawn, if it is visible. Adds its material to `scene`.
pub(super) fn add_cell(scene: &mut Scene, manifest: &Manifest, survey: &Survey) -> Option<RodLook> {
    let cell = &manifest.cell;
    if !cell.visible {
        return None;
    }
    let radius = cell.radius.unwrap_or_else(|| {
        let diagonals = survey.cells.iter().map(SimulationCell::diagonal);
        let diagonal = diagonals.reduce(f64::max);
        narrow(RADIUS * diagonal.unwrap_or(survey.min.distance(survey.max)))
    });
    look(scene, radius, &ColorSetting::Rgb(cell.color), None)
}

/// The boxes of all cells with their edges, relative to the origin; none if they are not drawn.
pub(super) fn boxes(style: Option<&RodLook>, survey: &Survey) -> impl Iterator<Item = [Vec3; 2]> {
    let cells = style.into_iter().flat_map(move |style| {
        let reach = DVec3::splat(f64::from(style.radius));
        survey.cells.iter().map(move |cell| (cell.corners(), reach))
    });
    cells.map(move |(corners, reach)| {
        let min = corners.into_iter().reduce(DVec3::min).unwrap_or_default();
        let max = corners.into_iter().reduce(DVec3::max).unwrap_or_default();
        [min - reach, max + reach].map(|corner| (corner - survey.origin).as_vec3())
    })
}
