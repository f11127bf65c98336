//! Axes: the directions of x, y and z as the camera sees them.

use super::canvas::{Canvas, Color};
use super::{FrameView, Pen};

/// The axes of the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes {
    /// Names of the axes.
    pub names: [String; 3],
}

/// Colours of x, y and z, which people with a colour vision deficiency can tell apart (Okabe & Ito, 2008).
const COLORS: [Color; 3] = [
    [213.0 / 255.0, 94.0 / 255.0, 0.0],
    [0.0, 158.0 / 255.0, 115.0 / 255.0],
    [0.0, 114.0 / 255.0, 178.0 / 255.0],
];

/// Lengths in units of the size of text.
const ARM: f32 = 2.0;
const LABEL: f32 = 2.6;
const HALF_SIDE: f32 = 3.1;
const HEAD: f32 = 0.4;

impl Axes {
    pub(super) fn measure(&self, pen: &Pen) -> [f32; 2] {
        let widths = self.names.iter().map(|name| pen.font.width(name));
        let widest = widths.fold(0.0, f32::max);
        let half = HALF_SIDE * pen.font.size;
        [2.0 * half.max(LABEL * pen.font.size + 0.5 * widest), 2.0 * half]
    }

    pub(super) fn draw(
        &self,
        canvas: &mut dyn Canvas,
        corner: [f32; 2],
        pen: &Pen,
        frame: &FrameView,
    ) {
        let size = pen.font.size;
        let [width, height] = self.measure(pen);
        let center = [corner[0] + 0.5 * width, corner[1] + 0.5 * height];
        let at = |axis: [f32; 3], length: f32| {
            [center[0] + length * size * axis[0], center[1] - length * size * axis[1]]
        };
        // The farthest first
        let mut order = [0, 1, 2];
        order.sort_by(|a: &usize, b: &usize| frame.axes[*b][2].total_cmp(&frame.axes[*a][2]));
        let line = 2.0 * pen.line;
        for i in order {
            let axis = frame.axes[i];
            let tip = at(axis, ARM);
            canvas.line(center, tip, line, COLORS[i]);
            // An arrow head, unless the axis points at the viewer
            let flat = (axis[0] * axis[0] + axis[1] * axis[1]).sqrt();
            if flat > 0.2 {
                let along = [axis[0] / flat, -axis[1] / flat];
                for side in [-0.5, 0.5] {
                    let back = [
                        tip[0] - HEAD * size * (along[0] + side * along[1]),
                        tip[1] - HEAD * size * (along[1] - side * along[0]),
                    ];
                    canvas.line(tip, back, line, COLORS[i]);
                }
            }
            // Names of axes along the view would hide each other
            let reach = if flat > 0.2 { LABEL } else { LABEL - ARM };
            let [x, y] = if flat > 0.2 {
                at([axis[0] / flat, axis[1] / flat, 0.0], ARM * flat + reach - ARM)
            } else {
                [center[0] - 0.6 * size, center[1] + 0.6 * size]
            };
            let name = &self.names[i];
            pen.label(canvas, name, x - 0.5 * pen.font.width(name), y);
        }
    }
}
