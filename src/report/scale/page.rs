use super::{MADE_BY, ScaleReport};
pub fn html(_: &ScaleReport) -> String {
    format!("<title>{MADE_BY}")
}
