//! `spherule export openjd`: a job template.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;
use spherule_jobs::export::openjd::{
    FRAMES, HostRequirements, JobTemplate, NOTIFY_SECONDS, PathParameter, TemplateFormat, literal,
    parameter,
};

use super::super::paths::absolute;
use super::super::{CliError, Outcome};
use super::paths::inside;
use super::{CommonArgs, ExportJob, grace, normalized, text, write_output};
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
    let format = template_format(output)?;
    // Engines have no common limit on the number of tasks
    let export_job = ExportJob::read(&args.common, NonZeroUsize::MAX)?;
    let place = match output {
        Some(path) => absolute(path)?,
        None => export_job.manifest_file.clone(),
    };
    let template_dir = normalized(place.parent().unwrap_or(Path::new("/")));
    let paths = job_paths(&export_job, &template_dir)?;
    let template = template(args, &export_job, &paths)?;
    write_output(&args.common, &template.text(format)?)?;
    print_usage(args, &export_job, &template_dir, &paths);
    Ok(Outcome::Done)
}

/// Prints how to use the template.
fn print_usage(args: &OpenjdArgs, export_job: &ExportJob, template_dir: &Path, paths: &[JobPath]) {
    message!("{}", export_job.chunks);
    if export_job.input_dir.is_none() {
        note!("the particles have no directory in common, so none is declared as input");
    }
    let options: Vec<String> = paths.iter().filter_map(JobPath::option).collect();
    if !options.is_empty() {
        note!("engines accept no default for a path outside the template's directory");
    }
    let file = args.common.output.as_deref();
    if file.is_none() {
        note!("its paths are relative to {}", template_dir.display());
    }
    let file = file.unwrap_or(Path::new("FILE"));
    message!("try it with: openjd run {}{}", file.display(), options.concat());
}

/// A path of the job, and its parameter in the template.
struct JobPath {
    parameter: PathParameter,
    /// Absolute.
    path: PathBuf,
}

impl JobPath {
    /// The option that sets the path if it has no default.
    fn option(&self) -> Option<String> {
        let name = self.parameter.name;
        let option = || format!(" -p '{name}={}'", self.path.display());
        self.parameter.default.is_none().then(option)
    }
}

/// The paths of the job, for a template in `template_dir`.
fn job_paths(export_job: &ExportJob, template_dir: &Path) -> Result<Vec<JobPath>, CliError> {
    // A default is relative to the template, if the path is within its directory
    let job_path = |name, description, path: &Path, is_directory, is_output| {
        let default = inside(path, template_dir).map(|p| text(&p).map(str::to_owned));
        Ok::<_, CliError>(JobPath {
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
    let manifest = "The manifest of the job.";
    // Add the paths, each as a parameter that a submitter can change
    let mut all = vec![job_path("Manifest", manifest, &export_job.manifest_file, false, false)?];
    if let Some(dir) = &export_job.input_dir {
        let input = "Directory of the particles. Hosts read them from the path in the manifest. Farms that copy \
                     files copy this directory.";
        all.push(job_path("InputDir", input, dir, true, false)?);
    }
    let output = "Directory of the images and of the job's records.";
    all.push(job_path("OutDir", output, &export_job.out_dir, true, true)?);
    Ok(all)
}

/// The file format of the output's extension. Engines recognise templates by it.
fn template_format(output: Option<&Path>) -> Result<TemplateFormat, CliError> {
    let Some(path) = output else {
        return Ok(TemplateFormat::Yaml);
    };
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    match extension.as_ref().and_then(|e| e.to_str()) {
        Some("yaml" | "yml") => Ok(TemplateFormat::Yaml),
        Some("json") => Ok(TemplateFormat::Json),
        _ => Err(CliError::other(format!(
            "{}: engines recognise a template by its name, which must end in .template.yaml or .template.json",
            path.display()
        ))),
    }
}

fn template<'a>(
    args: &OpenjdArgs,
    export_job: &'a ExportJob,
    paths: &[JobPath],
) -> Result<JobTemplate<'a>, CliError> {
    let image = literal("image name", &export_job.image_name)?;
    // The name of the directory becomes part of --output
    let output = format!("{}/{image}", text(&export_job.out_dir)?);
    OutputPattern::parse(&output)
        .map_err(|e| CliError::other(format!("{output}: {e}; rename the directory")))?;
    // Each task runs `render` on its chunk
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
        name: &export_job.name,
        description: export_job.title(),
        step: "Render",
        program: ("Spherule", text(&export_job.program)?),
        paths: paths.iter().map(|p| p.parameter.clone()).collect(),
        arguments: arguments.map(str::to_owned).to_vec(),
        frames: &export_job.frames,
        chunks: &export_job.chunks,
        host: HostRequirements {
            system: match std::env::consts::OS {
                known @ ("linux" | "macos" | "windows") => Some(known),
                _ => None,
            },
            cpus: args.cpus,
            memory: args.common.mem.or(export_job.memory_limit).map(|size| size.0),
        },
    })
}
