//! Colours and markers of series, and the legend.
//!
//! Colours follow Okabe and Ito, "Color Universal Design" (2008); light ones are darkened to a contrast of 3:1
//! against white, and have lighter versions for dark pages. Series also have different markers, for readers who
//! cannot distinguish the colours.

use std::fmt::Write as _;

use super::Line;
use super::drawn::Drawn;
use super::svg::FINE;
use crate::escape::escaped;

/// Colours on white, by hue.
const COLORS: [&str; 7] =
    ["#0072b2", "#d55e00", "#008f68", "#b0478a", "#8f6d00", "#3a96cf", "#444444"];

/// The style rules that plots need on their page: series colours in light and dark mode, text, grid, legend.
pub const CSS: &str = "\
figure.plot{margin:0;min-width:0}
figure.plot figcaption{font-weight:600;margin-bottom:.4rem}
svg.plot{display:block;width:100%;height:auto;overflow:visible}
svg.plot text{fill:var(--ink)}
svg.plot .ink{stroke:var(--ink)}
svg.plot .grid{stroke:var(--grid)}
.hollow{fill:var(--page)}
.legend{list-style:none;display:flex;flex-wrap:wrap;gap:.2rem 1.1rem;margin:.4rem 0 0;padding:0}
.legend li{display:flex;align-items:center;gap:.4rem;overflow-wrap:anywhere}
.legend svg{flex:none;width:32px;height:14px}
.empty,.note{color:var(--faint);margin:.4rem 0 0}
.empty{border:1px dashed var(--grid);border-radius:6px;padding:2rem 1rem;text-align:center}
@media (prefers-color-scheme:dark){
.hue-0{stroke:#4da3e0;fill:#4da3e0}
.hue-1{stroke:#ff8a3d;fill:#ff8a3d}
.hue-2{stroke:#2fc79a;fill:#2fc79a}
.hue-3{stroke:#e79cc9;fill:#e79cc9}
.hue-4{stroke:#e8d44d;fill:#e8d44d}
.hue-5{stroke:#b5ddf7;fill:#b5ddf7}
.hue-6{stroke:#dddddd;fill:#dddddd}
}
";

/// Opens the group of a series, which defines the style of its content.
pub(super) fn group(hue: usize, kind: &str) -> String {
    let hue = hue % COLORS.len();
    let color = COLORS[hue];
    format!(
        "<g class=\"{kind} hue-{hue}\" stroke=\"{color}\" fill=\"{color}\" stroke-width=\"1.8\" \
         stroke-linejoin=\"round\" stroke-linecap=\"round\">"
    )
}

/// Opens the group of lines or of markers of a series.
pub(super) const fn part(line: Line, markers: bool) -> &'static str {
    match (line, markers) {
        (Line::Dashed, false) => "<g stroke-dasharray=\"5 4\">",
        (Line::Dashed, true) => "<g class=\"hollow\" fill=\"#ffffff\" stroke-width=\"1.4\">",
        _ => "<g>",
    }
}

/// Corners of the marker of `hue` around zero, in fine units; None for a circle.
pub(super) fn marker(hue: usize) -> Option<&'static [(i32, i32)]> {
    const SQUARE: [(i32, i32); 4] = [(-26, -26), (26, -26), (26, 26), (-26, 26)];
    const UP: [(i32, i32); 3] = [(0, -36), (34, 24), (-34, 24)];
    const DIAMOND: [(i32, i32); 4] = [(0, -38), (32, 0), (0, 38), (-32, 0)];
    const DOWN: [(i32, i32); 3] = [(0, 36), (34, -24), (-34, -24)];
    const BAR: [(i32, i32); 4] = [(-12, -38), (12, -38), (12, 38), (-12, 38)];
    const DASH: [(i32, i32); 4] = [(-38, -12), (38, -12), (38, 12), (-38, 12)];
    match hue % COLORS.len() {
        0 => None,
        1 => Some(&SQUARE),
        2 => Some(&UP),
        3 => Some(&DIAMOND),
        4 => Some(&DOWN),
        5 => Some(&BAR),
        _ => Some(&DASH),
    }
}

/// Radius of the round marker, in fine units.
pub(super) const MARKER_RADIUS: i32 = 28;

/// The names of the series with a sample of each.
pub(super) fn legend(series: &[Drawn]) -> String {
    let mut html = "<ul class=\"legend\">\n".to_owned();
    for drawn in series {
        // Draw a short line with a marker in its middle, in the style of the series
        let mut key = group(drawn.hue, "key");
        if drawn.line != Line::None {
            key += part(drawn.line, false);
            key += "<path fill=\"none\" d=\"M1 7L31 7\"/></g>";
        }
        key += part(drawn.line, true);
        key += &match marker(drawn.hue) {
            None => format!(
                "<circle cx=\"16\" cy=\"7\" r=\"{}\"/>",
                f64::from(MARKER_RADIUS) / f64::from(FINE)
            ),
            Some(corners) => {
                let at = |fine: i32| f64::from(fine) / f64::from(FINE);
                let corners =
                    corners.iter().map(|(x, y)| format!("{} {}", 16.0 + at(*x), 7.0 + at(*y)));
                format!("<path d=\"M{}Z\"/>", corners.collect::<Vec<_>>().join("L"))
            }
        };
        key += "</g></g>";
        writeln!(
            html,
            "<li><svg viewBox=\"0 0 32 14\" aria-hidden=\"true\">{key}</svg><span>{}</span></li>",
            escaped(drawn.name)
        )
        .expect("a string takes everything");
    }
    html + "</ul>\n"
}
