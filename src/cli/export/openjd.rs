//! `spherule export openjd`: a job template.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;
use spherule_jobs::export::openjd::{
    FRAMES, HostRequirements, JobTemplate, NOTIFY_SECONDS, PathParameter, Spelling, literal,
    parameter,
};

use super::super::paths::absolute;
use super::super::{CliError, Outcome};
use super::place::inside;
use super::{CommonArgs, Work, deliver, grace, text, tidy};
use crate::manifest::OutputPattern;

#[derive(Debug, Args)]
pub(super) struct OpenjdArgs {
    #[command(flatten)]
    common: CommonArgs,
    /// Processors that a host must have.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    cpus: Option<u16>,
}

pub(super) fn run(args: &OpenjdArgs) -> Result<Outcome, CliError> {
    let output = args.common.output.as_deref();
    let spelling = spelling(output)?;
    // Engines have no usual limit.
    let work = Work::read(&args.common, NonZeroUsize::MAX)?;
    let home = match output {
        Some(path) => absolute(path)?,
        None => work.manifest_file.clone(),
    };
    let home = tidy(home.parent().unwrap_or(Path::new("/")));
    let places = places(&work, &home)?;
    let template = template(args, &work, &places)?;
    deliver(&args.common, &template.text(spelling)?)?;
    tell(args, &work, &home, &places);
    Ok(Outcome::Done)
}

/// What to do with the template.
fn tell(args: &OpenjdArgs, work: &Work, home: &Path, places: &[Place]) {
    say!("{}", work.chunks);
    if work.input_dir.is_none() {
        note!("the particles have no directory in common, so none is declared as input");
    }
    let given: Vec<String> = places.iter().filter_map(Place::option).collect();
    if !given.is_empty() {
        note!("engines take no default for what is not below the template's directory");
    }
    let file = args.common.output.as_deref();
    if file.is_none() {
        note!("relative paths in it begin at {}", home.display());
    }
    let file = file.unwrap_or(Path::new("FILE"));
    say!(
        "try it with: openjd run {}{}",
        file.display(),
        given.concat()
    );
}

/// A path of the job, as the template is to have it.
struct Place {
    parameter: PathParameter,
    /// Absolute.
    path: PathBuf,
}

impl Place {
    /// What has to be said where there is no default.
    fn option(&self) -> Option<String> {
        let name = self.parameter.name;
        let option = || format!(" -p '{name}={}'", self.path.display());
        self.parameter.default.is_none().then(option)
    }
}

/// The paths of the job, for a template in the directory `home`.
fn places(work: &Work, home: &Path) -> Result<Vec<Place>, CliError> {
    let place = |name, description, path: &Path, is_directory, is_output| {
        let default = inside(path, home).map(|p| text(&p).map(str::to_owned));
        Ok::<_, CliError>(Place {
            parameter: PathParameter {
                name,
                description,
                default: default.transpose()?,
                is_directory,
                is_output,
            },
            path: path.to_owned(),
        })
    };
    let manifest = "What is rendered, and how.";
    let mut all = vec![place(
        "Manifest",
        manifest,
        &work.manifest_file,
        false,
        false,
    )?];
    if let Some(dir) = &work.input_dir {
        let input = "Where the particles are. The manifest says where hosts look for them; farms that \
                     copy files copy this directory.";
        all.push(place("InputDir", input, dir, true, false)?);
    }
    let output = "Where the images go, and the job's record of them.";
    all.push(place("OutDir", output, &work.out_dir, true, true)?);
    Ok(all)
}

/// Engines go by the name.
fn spelling(output: Option<&Path>) -> Result<Spelling, CliError> {
    let Some(path) = output else {
        return Ok(Spelling::Yaml);
    };
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    match extension.as_ref().and_then(|e| e.to_str()) {
        Some("yaml" | "yml") => Ok(Spelling::Yaml),
        Some("json") => Ok(Spelling::Json),
        _ => Err(CliError::other(format!(
            "{}: engines know a template by its name; end it in .template.yaml or .template.json",
            path.display()
        ))),
    }
}

fn template<'a>(
    args: &OpenjdArgs,
    work: &'a Work,
    places: &[Place],
) -> Result<JobTemplate<'a>, CliError> {
    let image = literal("image name", &work.image_name)?;
    // The directory's name becomes part of --output.
    let output = format!("{}/{image}", text(&work.out_dir)?);
    OutputPattern::parse(&output)
        .map_err(|e| CliError::other(format!("{output}: {e}; rename the directory")))?;
    let arguments = [
        "render",
        &parameter("Manifest"),
        "--frames",
        FRAMES,
        "--output",
        &format!("{}/{image}", parameter("OutDir")),
        "--progress",
        "openjd",
        "--grace",
        &grace(NOTIFY_SECONDS),
    ];
    Ok(JobTemplate {
        name: &work.name,
        description: work.title(),
        step: "Render",
        program: ("Spherule", text(&work.program)?),
        paths: places.iter().map(|p| p.parameter.clone()).collect(),
        arguments: arguments.map(str::to_owned).to_vec(),
        frames: &work.frames,
        chunks: &work.chunks,
        host: HostRequirements {
            system: match std::env::consts::OS {
                known @ ("linux" | "macos" | "windows") => Some(known),
                _ => None,
            },
            cpus: args.cpus,
            memory: args.common.mem.or(work.memory_limit).map(|size| size.0),
        },
    })
}
