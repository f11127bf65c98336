//! Rods next to the particles of a frame: how they look, and the edges of the simulation cell.

use glam::{DVec3, Vec3};
use spherule_formats::SimulationCell;

use super::SharedFrame;
use super::decoded::colors_by;
use super::load_error::LoadError;
use super::setup::{RodLook, Setup};
use crate::scene::MaterialId;
use crate::surface::rods::{Caps, Rod, RodTree};
use crate::surface::{Shape, rods::RodSurface};

impl RodLook {
    /// `rods` of a frame with this number, which was read from a file. `owners`: the particles by their part of the
    /// colour.
    ///
    /// # Errors
    /// The frame lacks the attribute of the colours.
    pub(super) fn rods(
        &self,
        (setup, frame): (&Setup, &SharedFrame<'_>),
        place: (i64, &str),
        (rods, caps): (Vec<Rod>, Caps),
        owners: impl Iterator<Item = usize>,
    ) -> Result<FrameRods, LoadError> {
        let colors = match &self.color {
            Some(rule) => {
                let of_particles = colors_by(setup, frame, place, rule)?;
                owners.map(|particle| of_particles.get(particle)).collect()
            }
            None => Vec::new(),
        };
        Ok(FrameRods {
            tree: RodTree::new(rods, caps).with_colors(colors),
            material: self.material,
        })
    }
}

/// Rods of a frame with one material.
#[derive(Debug)]
pub struct FrameRods {
    tree: RodTree,
    material: MaterialId,
}

impl FrameRods {
    /// The rods as a shape.
    pub(super) fn surface(&self) -> Box<dyn Shape + '_> {
        Box::new(RodSurface::new(&self.tree, self.material))
    }

    /// Memory, bytes.
    pub(super) const fn bytes(&self) -> u64 {
        self.tree.bytes() as u64
    }
}

/// The rods of a frame with this `cell`, drawn in a `style`, relative to `origin`. Passes notes to `notes`.
pub(super) fn rods_of(
    (style, origin): (Option<&RodLook>, DVec3),
    cell: Option<&SimulationCell>,
    frame: i64,
    notes: &mut Vec<String>,
) -> Vec<FrameRods> {
    let Some(style) = style else {
        return Vec::new();
    };
    let Some(cell) = cell else {
        notes.push(format!("frame {frame}: no simulation cell in the file, so that none is drawn"));
        return Vec::new();
    };
    vec![cell_edges(cell, style, origin)]
}

/// The edges of `cell`, relative to `origin`.
fn cell_edges(cell: &SimulationCell, style: &RodLook, origin: DVec3) -> FrameRods {
    let local = |corner: DVec3| -> Vec3 { (corner - origin).as_vec3() };
    let edges = cell.edges().into_iter();
    let rods = edges.map(|edge| Rod::line(edge.map(local), style.radius));
    FrameRods {
        // Capsules, so that edges meet in spheres
        tree: RodTree::new(rods.collect(), Caps::Round),
        material: style.material,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray::Ray;

    #[test]
    fn the_edges_of_a_tilted_cell_are_hit_and_its_faces_are_not() {
        let vectors = [[10.0, 0.0, 0.0], [3.0, 8.0, 0.0], [-1.0, 2.0, 6.0]];
        let origin = DVec3::new(1e6, -2e6, 3e6);
        let cell = SimulationCell::new(origin, vectors.map(DVec3::from_array), [true; 3]).unwrap();
        let style = RodLook { radius: 0.05, color: None, material: MaterialId::GROUND };
        let rods = cell_edges(&cell, &style, origin);
        let surface = rods.surface();
        assert_eq!(surface.material(), style.material);
        // Look at points of the edges and of the faces from above each corner's diagonal
        let [a, b, c] = cell.vectors.map(|vector| vector.as_vec3());
        let is_hit = |point: Vec3, from: Vec3| {
            let eye = point + from;
            let ray = Ray::new(eye, -from.normalize());
            surface.nearest(&ray).is_some_and(|hit| hit.t < from.length() + 0.1)
        };
        for point in [0.3 * a, b + 0.7 * a, c + 0.5 * a + b, a + 0.2 * c, a + b + 0.9 * c] {
            assert!(is_hit(point, Vec3::new(0.1, -3.0, 2.0)), "{point}");
        }
        for point in [0.3 * a + 0.4 * b, 0.5 * (a + c), 0.3 * b + 0.6 * c] {
            assert!(!is_hit(point, Vec3::new(0.1, -0.3, 0.2)), "{point}");
        }
    }
}
