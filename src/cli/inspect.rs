//! `spherule inspect`: what is in particle files, for people and (`--json`) for scripts.

use std::collections::HashSet;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};
use spherule_formats::blocks::Block;
use spherule_formats::detect::Format;
use spherule_formats::native::{FrameIndex, layout};
use spherule_formats::sequence::lone_frame_number;
use spherule_formats::stats::{AttributeStats, FrameStats, Number};
use spherule_formats::{FrameError, FrameFile, Positions, RawParticles, Sequence, SequenceInput};

use super::{CliError, Outcome};

#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// Files, directories or patterns.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// One JSON object a particle frame, one a line.
    #[arg(long)]
    json: bool,
}

/// One particle frame of a file.
struct Inspected<'a> {
    file: &'a Path,
    format: &'static str,
    frame: Option<i64>,
    raw: &'a RawParticles,
    stats: FrameStats,
    stored: f64,
    /// What a native frame says of itself.
    native: Option<FrameIndex>,
}

pub(super) fn run(args: &InspectArgs) -> Result<Outcome, CliError> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    let mut outcome = Outcome::Done;
    for meant in expand(&args.files) {
        let inspected = match meant {
            Meant::File(file, number) => {
                inspect(&file, number, args.json, &mut out).map_err(|e| (file, e.to_string()))
            }
            Meant::Nothing(argument, why) => Err((argument, why)),
        };
        let written = match inspected {
            Ok(written) => written,
            Err((file, error)) => {
                outcome = Outcome::SomeFailed;
                if args.json {
                    let shown = file.display().to_string();
                    writeln!(out, "{}", json!({"file": shown, "error": error}))
                } else {
                    say!("error: {error}");
                    Ok(())
                }
            }
        };
        match written.and_then(|()| out.flush()) {
            // Whoever reads has seen enough.
            Err(e) if e.kind() == io::ErrorKind::BrokenPipe => return Ok(outcome),
            other => other.map_err(CliError::io(Path::new("standard output")))?,
        }
    }
    Ok(outcome)
}

/// What an argument stands for.
enum Meant {
    /// A file, with the frame number that its name tells where it is one of a sequence.
    File(PathBuf, Option<i64>),
    /// No file, and why.
    Nothing(PathBuf, String),
}

/// All that is meant; an argument that means nothing does not hinder the others.
fn expand(arguments: &[PathBuf]) -> Vec<Meant> {
    let mut all = Vec::new();
    let mut known = HashSet::new();
    for argument in arguments {
        match SequenceInput::from_path(argument) {
            SequenceInput::Files(listed) => {
                for file in listed {
                    let number = lone_frame_number(&file);
                    known.insert(file.clone());
                    all.push(Meant::File(file, number));
                }
            }
            input => match Sequence::open(&input) {
                Err(error) => all.push(Meant::Nothing(argument.clone(), error.to_string())),
                Ok(sequence) => {
                    for frame in sequence.frames() {
                        // A file with many steps is in many frames.
                        for part in &frame.parts {
                            if known.insert(part.path.clone()) {
                                all.push(Meant::File(part.path.clone(), Some(frame.number)));
                            }
                        }
                    }
                }
            },
        }
    }
    all
}

/// Reads one file; the outer error is the file's, the inner one the output's.
fn inspect(
    path: &Path,
    number: Option<i64>,
    as_json: bool,
    out: &mut impl Write,
) -> Result<io::Result<()>, FrameError> {
    let file = FrameFile::open(path)?;
    let several = file.steps().len() > 1;
    for (index, step) in file.steps().iter().enumerate() {
        let raw = file.read(index)?;
        let stats = FrameStats::of(&raw);
        let running = i64::try_from(index).ok();
        #[expect(clippy::cast_precision_loss, reason = "file sizes are below 2^53")]
        let inspected = Inspected {
            file: path,
            format: file.format().name(),
            frame: step.number.or(if several { running } else { number }),
            stored: file.stored_len() as f64
                * (step.span.len() as f64 / file.bytes().len().max(1) as f64),
            native: (file.format() == Format::Spf)
                .then(|| layout::parse(file.bytes()).ok())
                .flatten(),
            raw: &raw,
            stats,
        };
        let written = if as_json {
            writeln!(out, "{}", inspected.to_json())
        } else {
            inspected.print(out)
        };
        if written.is_err() {
            return Ok(written);
        }
    }
    Ok(Ok(()))
}

impl Inspected<'_> {
    fn encoding(&self) -> &'static str {
        if let Some(index) = &self.native {
            return index.encoding().name();
        }
        match self.raw.positions {
            Positions::F32(_) => "f32",
            Positions::F64(_) => "f64",
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "counts are below 2^53")]
    fn bytes_per_particle(&self) -> Option<f64> {
        let all = self.stats.count + self.stats.dropped;
        (all > 0).then(|| self.stored / all as f64)
    }

    fn to_json(&self) -> Value {
        let stats = &self.stats;
        json!({
            "file": self.file.display().to_string(),
            "format": self.format,
            "frame": self.frame,
            "time": self.raw.time,
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
            "attributes": stats.attributes.iter().map(attribute_json).collect::<Vec<_>>(),
            "encoding": self.encoding(),
            "error_bound": self.native.as_ref().map_or(0.0, |index| index.max_error),
            "bytes_per_particle": self.bytes_per_particle(),
        })
    }

    fn print(&self, out: &mut impl Write) -> io::Result<()> {
        let stats = &self.stats;
        write!(out, "{}", self.file.display())?;
        if let Some(frame) = self.frame {
            write!(out, "  frame {frame}")?;
        }
        if let Some(time) = self.raw.time {
            write!(out, "  time {time}")?;
        }
        writeln!(out)?;
        let dropped = match stats.dropped {
            0 => String::new(),
            n => format!(", {n} dropped (not finite)"),
        };
        writeln!(
            out,
            "  {}, {} positions: {} particles{dropped}",
            self.format,
            self.encoding(),
            stats.count
        )?;
        if let Some(index) = &self.native {
            let wide = index.wide.len / size_of::<Block>() as u64;
            writeln!(
                out,
                "  largest error {:e}, {wide} blocks kept as f32, origin {:?}",
                index.max_error, index.origin
            )?;
        }
        if let Some((min, max)) = stats.bounds {
            writeln!(out, "  bounds {min} to {max}")?;
        }
        match stats.radius {
            None => writeln!(out, "  radius not in the file")?,
            Some((low, high)) if low == high => writeln!(out, "  radius {low}")?,
            Some((low, high)) => writeln!(out, "  radius {low} to {high}")?,
        }
        for attribute in &stats.attributes {
            print_attribute(attribute, out)?;
        }
        Ok(())
    }
}

fn print_attribute(attribute: &AttributeStats, out: &mut impl Write) -> io::Result<()> {
    write!(
        out,
        "  {} ({} x {}):",
        attribute.name,
        attribute.scalar_type.name(),
        attribute.components.len()
    )?;
    for component in &attribute.components {
        match (component.min, component.max) {
            (Some(min), Some(max)) => write!(out, " [{min} .. {max}]")?,
            _ => write!(out, " [no values]")?,
        }
    }
    writeln!(out)
}

/// One value a component.
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
