//! What the types of values do not say: which numbers and texts a key takes, which keys must be there, and
//! which need one another. The tests hold all of it against the reader.

use serde_json::{Value, json};

use super::{NAME_PATTERN, rgb_schema};
use crate::accel::SbvhSettings;
use crate::manifest::surface::{MAX_THRESHOLD, SMOOTHING_LENGTHS, VOXELS};
use crate::manifest::work::MAX_RETRIES;
use crate::render::{MAX_DEPTH, MAX_SAMPLES, MAX_SIDE, MIN_WEIGHTS};

/// Keys without a default.
pub(super) const REQUIRED: [&str; 7] = [
    "input.path",
    "camera.key.frame",
    "camera.key.eye",
    "camera.key.look_at",
    "light.type",
    "light.position",
    "light.direction",
];

/// What else holds for values of `key`, in which items of lists have no numbers.
pub(super) fn limits(key: &str) -> Value {
    match key {
        "input.parts" => json!({ "items": { "pattern": NAME_PATTERN }, "minItems": 1 }),
        "camera.up" | "camera.key.up" | "light.direction" => {
            json!({ "contains": { "not": { "const": 0 } } })
        }
        "camera.fov" | "camera.key.fov" => {
            json!({ "exclusiveMinimum": 0, "exclusiveMaximum": 180 })
        }
        "camera.elevation" => from_to(-90, 90),
        "image.width" | "image.height" => from_to(1, MAX_SIDE),
        "image.samples" => from_to(1, MAX_SAMPLES),
        "render.max_depth" => from_to(1, MAX_DEPTH),
        "render.min_weight" => {
            json!({ "anyOf": [{ "const": 0 }, from_to(*MIN_WEIGHTS.start(), *MIN_WEIGHTS.end())] })
        }
        "render.sbvh_alpha" => from_to(*SbvhSettings::ALPHAS.start(), *SbvhSettings::ALPHAS.end()),
        "render.sbvh_budget" => {
            from_to(*SbvhSettings::BUDGETS.start(), *SbvhSettings::BUDGETS.end())
        }
        "render.ground_color" | "light.color" => rgb_schema(),
        "surface.smoothing" => from_to(0, 1),
        "surface.voxel" => from_to(VOXELS[0], VOXELS[1]),
        "surface.smoothing_length" => from_to(SMOOTHING_LENGTHS[0], SMOOTHING_LENGTHS[1]),
        "surface.threshold" => json!({ "exclusiveMinimum": 0, "maximum": MAX_THRESHOLD }),
        "material.absorption" => {
            let mut rgb = rgb_schema();
            rgb["items"]["maximum"] = json!(1);
            rgb
        }
        "material.ambient" | "material.diffuse" | "material.specular" | "light.intensity" => {
            from_to(0, f32::MAX)
        }
        "material.shininess" | "material.ior" => {
            json!({ "exclusiveMinimum": 0, "maximum": f32::MAX })
        }
        "material.reflection" | "material.transmission" => from_to(0, 1),
        "output.path" => json!({ "pattern": r"[^/\\]\.[eE][xX][rR]$" }),
        "output.channels" => json!({ "minItems": 1, "uniqueItems": true }),
        "output.preview_exposure" => from_to(-100, 100),
        "output.fps" | "job.takeover_after" | "job.idle" => json!({ "exclusiveMinimum": 0 }),
        "job.retries" => from_to(0, MAX_RETRIES),
        "job.stop_file" => json!({ "pattern": NAME_PATTERN }),
        _ => json!({}),
    }
}

fn from_to(low: impl Into<Value>, high: impl Into<Value>) -> Value {
    json!({ "minimum": low.into(), "maximum": high.into() })
}

/// What keys of `section` need of one another.
pub(super) fn conditions(section: &str) -> Option<Value> {
    match section {
        "camera" => Some(json!([
            mode_needs(&["fixed"], &json!({ "required": ["eye", "look_at"] })),
            mode_needs(&["keys"], &json!({ "required": ["key"] })),
            mode_needs(
                &["auto", "turntable", "keys"],
                &json!({ "properties": { "eye": false, "look_at": false } }),
            ),
            // Not given, the mode is what the other keys make of it.
            {
                "if": { "required": ["eye"], "properties": { "mode": false } },
                "then": { "required": ["look_at"] },
            },
            {
                "if": { "properties": { "mode": false, "eye": false } },
                "then": { "properties": { "look_at": false } },
            },
        ])),
        "job" => Some(json!([{
            "if": { "required": ["memory_ceiling"] },
            "then": { "required": ["isolate"], "properties": { "isolate": { "const": true } } },
        }])),
        _ => None,
    }
}

fn mode_needs(modes: &[&str], needs: &Value) -> Value {
    json!({
        "if": { "required": ["mode"], "properties": { "mode": { "enum": modes } } },
        "then": needs,
    })
}

/// What a section is for.
pub(super) fn about(section: &str) -> &'static str {
    match section {
        "input" => "Which particles, and what they mean",
        "camera" => "Where the picture is taken from",
        "camera.key" => "Places that the camera passes through",
        "image" => "How large the picture is",
        "render" => "How it is traced",
        "surface" => "What rays meet, beside its kind in render; lengths are in particle radii",
        "material" => "What particles are made of",
        "light" => "What shines; without any, a key light and a soft fill are placed by the camera",
        "output" => "Which images are written, with what in them",
        "job" => "How the work is gone about; no image depends on it",
        _ => "",
    }
}
