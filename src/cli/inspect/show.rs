//! Prints the result of `inspect`.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use spherule_files::{counted, one_line};
use spherule_formats::SimulationCell;
use spherule_formats::stats::{AttributeStats, Number};
use spherule_frame::join::PART;

use super::{Inspected, InspectedList};
use crate::cli::CliError;
use crate::cli::print::{self, Reader};
use crate::cli::render::CELL_HINT;

impl InspectedList {
    /// Prints one line of JSON, or several for people.
    pub(super) fn print(&self, as_json: bool) -> Result<Reader, CliError> {
        if as_json {
            let summary = &self.summary;
            return print::json(&json!({
                "file": self.path.display().to_string(),
                "list": summary.kind,
                "steps": summary.step_count,
                "files": summary.file_count,
                "parts": self.parts,
                "times": self.times,
            }));
        }
        let mut lines = vec![self.path.display().to_string(), format!("  {}", self.summary)];
        if !self.parts.is_empty() {
            lines.push(format!("  parts {}", self.parts.join(", ")));
        }
        print::lines(lines)
    }
}

impl Inspected<'_> {
    /// Prints one line of JSON, or several for people.
    pub(super) fn print(&self, as_json: bool) -> Result<Reader, CliError> {
        if as_json { print::json(&self.to_json()) } else { print::lines(self.to_lines()) }
    }

    fn to_json(&self) -> Value {
        let stats = &self.stats;
        let mut object = json!({
            "file": self.file.display().to_string(),
            "format": self.format,
            "frame": self.frame,
            "time": self.time,
            "count": stats.count,
            "dropped": stats.dropped,
            "radius": match stats.radius {
                None => Value::Null,
                Some((low, high)) if low == high => json!(low),
                Some((low, high)) => json!({"min": low, "max": high}),
            },
            "bounds": stats.bounds.map(|(min, max)| {
                json!({"min": min.to_array(), "max": max.to_array()})
            }),
            "mean": stats.mean.map(|m| m.to_array()),
            "attributes": stats.attributes.iter().map(|a| self.attribute_json(a)).collect::<Vec<_>>(),
            "cell": self.cell.map(|cell| json!({
                "origin": cell.origin.to_array(),
                "vectors": cell.vectors.map(|vector| vector.to_array()),
                "periodic": cell.periodic,
            })),
            "parts": self.parts_json(),
            "bonds": self.bond_count,
            "topology": self.topology.map(|path| path.display().to_string()),
            "notes": self.notes,
            "encoding": self.encoding,
            "error_bound": self.native.as_ref().map_or(0.0, |native| native.index.max_error),
            "bytes_per_particle": self.bytes_per_particle,
        });
        if let Some(native) = &self.native {
            object["native"] = native.to_json();
        }
        if self.verified {
            object["verified"] = json!(true);
        }
        object
    }

    pub(super) fn to_lines(&self) -> Vec<String> {
        let stats = &self.stats;
        // Start with what every frame has
        let mut lines = vec![self.heading()];
        let dropped = match stats.dropped {
            0 => String::new(),
            n => format!(", {n} dropped (not finite or too far away)"),
        };
        lines.push(format!(
            "  {}, {} positions: {} particles{dropped}",
            self.format, self.encoding, stats.count
        ));
        if let Some(native) = &self.native {
            lines.extend(native.to_lines());
        }
        if let Some((min, max)) = stats.bounds {
            lines.push(format!("  bounds {min} to {max}"));
        }
        lines.extend(self.cell.as_ref().map(cell_line));
        lines.push(match stats.radius {
            None => "  radius not in the file".to_owned(),
            Some((low, high)) if low == high => format!("  radius {low}"),
            Some((low, high)) => format!("  radius {low} to {high}"),
        });
        let attributes = stats.attributes.iter();
        lines.extend(attributes.map(|a| attribute_line(a, self.labels.get(&a.name))));
        if self.bond_count > 0 {
            lines.push(format!("  {} (--bonds file draws them)", counted(self.bond_count, "bond")));
        }
        lines.extend(self.topology.map(|path| format!("  topology {}", path.display())));
        // End with what limits or confirms the rest
        if let Some(sample) = self.native.as_ref().and_then(|native| native.sample) {
            lines.push(format!("  values of attributes are from a sample of {sample} particles"));
        }
        lines.extend(self.notes.iter().map(|note| format!("  note: {note}")));
        if self.verified {
            let what = match self.native {
                Some(_) => "checksums, nodes, positions, radii and padding are sound",
                None => "every number could be read",
            };
            lines.push(format!("  verified: {what}"));
        }
        lines
    }

    /// Which frame of which file.
    fn heading(&self) -> String {
        let mut line = self.file.display().to_string();
        if let Some(frame) = self.frame {
            line += &format!("  frame {frame}");
        }
        if let Some(time) = self.time {
            line += &format!("  time {time}");
        }
        line
    }

    /// Numbers and names of the values of the attribute `part`; null without.
    fn parts_json(&self) -> Option<Vec<Value>> {
        let named = self.labels.get(PART)?.iter();
        Some(named.map(|(number, name)| json!({"number": number, "name": name})).collect())
    }

    /// One value per component.
    fn attribute_json(&self, attribute: &AttributeStats) -> Value {
        let mut object = attribute_json(attribute);
        object["labels"] = json!(self.labels.get(&attribute.name));
        // That of a sample means nothing.
        if self.native.as_ref().is_some_and(|n| n.sample.is_some()) {
            object["sum"] = Value::Null;
        }
        object
    }
}

fn cell_line(cell: &SimulationCell) -> String {
    let [a, b, c] = cell.vectors;
    let mut line = format!("  cell {a} {b} {c} from {}", cell.origin);
    let names: Vec<&str> = ["a", "b", "c"]
        .iter()
        .zip(cell.periodic)
        .filter(|(_, is)| *is)
        .map(|(name, _)| *name)
        .collect();
    if !names.is_empty() {
        line += &format!(", periodic along {}", names.join(", "));
    }
    line + &format!(" ({CELL_HINT})")
}

/// Most labels of an attribute that are printed.
const MAX_LABELS: usize = 12;

fn attribute_line(attribute: &AttributeStats, labels: Option<&BTreeMap<i64, String>>) -> String {
    let mut line = format!(
        "  {} ({} x {}):",
        attribute.name,
        attribute.scalar_type.name(),
        attribute.components.len()
    );
    for component in &attribute.components {
        line += &match (component.min, component.max) {
            (Some(min), Some(max)) => format!(" [{min} .. {max}]"),
            _ => " [no values]".to_owned(),
        };
    }
    if let Some(labels) = labels {
        let all: Vec<&String> = labels.values().filter(|label| !label.is_empty()).collect();
        let shown = all.iter().take(MAX_LABELS).map(|label| one_line((*label).clone()));
        let shown = shown.collect::<Vec<_>>().join(", ");
        let more = if all.len() > MAX_LABELS { ", ..." } else { "" };
        line += &format!(" {shown}{more} ({})", counted(all.len(), "name"));
    }
    line
}

fn attribute_json(attribute: &AttributeStats) -> Value {
    let each = |value: &dyn Fn(&spherule_formats::stats::ComponentStats) -> Value| {
        attribute.components.iter().map(value).collect::<Vec<_>>()
    };
    json!({
        "name": attribute.name,
        "type": attribute.scalar_type.name(),
        "components": attribute.components.len(),
        "min": each(&|c| c.min.map_or(Value::Null, number_json)),
        "max": each(&|c| c.max.map_or(Value::Null, number_json)),
        "mean": each(&|c| json!(c.mean)),
        "sum": each(&|c| number_json(c.sum)),
    })
}

/// Integers stay exact as far as JSON readers go: 64 bits, beyond that as text. JSON has no
/// infinities; they are null.
fn number_json(number: Number) -> Value {
    match number {
        Number::Float(x) => json!(x),
        Number::Int(n) => match (i64::try_from(n), u64::try_from(n)) {
            (Ok(n), _) => json!(n),
            (_, Ok(n)) => json!(n),
            _ => json!(n.to_string()),
        },
    }
}
