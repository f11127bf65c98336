//! `image.crop`: the part of the image that is rendered.

use serde_json::{Value as Json, json};
use spherule_tracer::render::MAX_SIDE;

use super::field::Field;
use super::key::Key;
use super::value::{Fault, FlagKind, Value};

/// A rectangle of pixels: `[x0, y0, x1, y1]`, from the top left corner, without column `x1` and row `y1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelBounds(pub [i32; 4]);

impl Value for PixelBounds {
    const FLAG: FlagKind = FlagKind::Integers;

    fn kind(_: &Key) -> String {
        "four whole numbers, such as [0, 0, 960, 540]".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let items = field.items().ok_or(Fault::Unwanted)?;
        let pixel = |item: &Field<'_>| {
            let pixel = i32::try_from(item.as_integer()?).ok()?;
            (pixel.unsigned_abs() <= MAX_SIDE).then_some(pixel)
        };
        let pixels: Option<Vec<i32>> = items.iter().map(pixel).collect();
        let bounds = pixels.and_then(|pixels| <[i32; 4]>::try_from(pixels).ok());
        bounds.map(Self).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        let [x0, y0, x1, y1] = self.0;
        format!("[{x0}, {y0}, {x1}, {y1}]")
    }

    fn schema(_: &Key) -> Json {
        let side = i64::from(MAX_SIDE);
        json!({
            "type": "array",
            "items": { "type": "integer", "minimum": -side, "maximum": side },
            "minItems": 4,
            "maxItems": 4,
        })
    }
}
