//! Hints for options that a command does not have.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error};

use crate::manifest::keys_called;

/// Options of other programs for fewer or more messages.
const QUIET: [&str; 4] = ["-q", "--quiet", "-v", "--verbose"];

/// `error` of the arguments of the command `name` of `program`, with hints that help.
pub(super) fn with_hints(error: Error, name: &str, program: &Command) -> Error {
    let Some(command) = program.find_subcommand(name) else {
        return error;
    };
    match error.kind() {
        ErrorKind::UnknownArgument => unknown_option(error, command),
        ErrorKind::ArgumentConflict => {
            let kinds = [ContextKind::InvalidArg, ContextKind::PriorArg];
            let mut options = kinds.into_iter().flat_map(|kind| texts(&error, kind));
            match options.find(|option| is_hidden(command, option)) {
                Some(option) => {
                    let option = option.split_whitespace().next().unwrap_or_default();
                    let what = format!("{option}: is for jobs, and `spherule {name}` has none\n");
                    Error::raw(ErrorKind::ArgumentConflict, what)
                }
                None => error,
            }
        }
        _ => error,
    }
}

/// The texts of this kind that belong to `error`.
fn texts(error: &Error, kind: ContextKind) -> Vec<String> {
    match error.get(kind) {
        Some(ContextValue::String(text)) => vec![text.clone()],
        Some(ContextValue::Strings(texts)) => texts.clone(),
        _ => Vec::new(),
    }
}

/// `error` about an option that `command` does not have.
fn unknown_option(mut error: Error, command: &Command) -> Error {
    if let Some(similar) = texts(&error, ContextKind::SuggestedArg).first() {
        if !is_hidden(command, similar) {
            return error;
        }
        error.remove(ContextKind::SuggestedArg);
    }
    // An unknown option is rarely meant as a file name
    error.remove(ContextKind::Suggested);
    let typed = texts(&error, ContextKind::InvalidArg);
    if let Some(hint) = typed.first().and_then(|typed| hint(typed, command)) {
        let hints = ContextValue::StyledStrs(vec![hint.into()]);
        error.insert(ContextKind::Suggested, hints);
    }
    error
}

/// Whether `option`, as messages show it, is one that the help of `command` does not list.
fn is_hidden(command: &Command, option: &str) -> bool {
    let name = option.split(['=', ' ']).next().unwrap_or_default();
    let mut all = command.get_arguments();
    all.any(|arg| {
        arg.is_hide_set() && arg.get_long().map(|long| format!("--{long}")) == Some(name.to_owned())
    })
}

/// What `command` has instead of the option `typed`.
fn hint(typed: &str, command: &Command) -> Option<String> {
    let has = |name: &str| {
        let mut all = command.get_arguments();
        all.any(|arg| arg.get_long() == Some(name) && !arg.is_hide_set())
    };
    if QUIET.contains(&typed) && has("progress") {
        return Some("'--progress none' prints only warnings and errors".to_owned());
    }
    let name = typed.strip_prefix("--").filter(|_| has("set"))?;
    let keys = keys_called(&name.replace('-', "_"));
    let options: Vec<String> = keys
        .iter()
        .map(|key| format!("'--set {key}=VALUE'"))
        .collect();
    (!options.is_empty()).then(|| {
        format!(
            "a key of the manifest has this name: {}",
            options.join(" or ")
        )
    })
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;
    use crate::cli::Cli;

    fn message(line: &str) -> String {
        let arguments: Vec<&str> = line.split_whitespace().collect();
        let error = Cli::try_parse_from(&arguments).expect_err("a wrong option");
        with_hints(error, arguments[1], &Cli::command()).to_string()
    }

    #[test]
    fn hints_name_what_the_command_has() {
        for (line, expected) in [
            (
                "spherule still a -o b.png --filter box",
                "'--set image.filter=VALUE'",
            ),
            (
                "spherule still a -o b.png --fov 3",
                "'--set camera.fov=VALUE'",
            ),
            ("spherule render a --widht 3", "'--width'"),
            ("spherule render a -q", "'--progress none'"),
            (
                "spherule still a -o b.png --isolate",
                "--isolate: is for jobs, and `spherule still` has none",
            ),
        ] {
            let text = message(line);
            assert!(text.contains(expected), "{line}: {text}");
        }
    }

    #[test]
    fn useless_hints_are_left_out() {
        for (line, useless) in [
            ("spherule still a -o b.png --slice 1", "isolate"),
            ("spherule still a -o b.png --filter box", "--idle"),
            ("spherule still a -o b.png --title x", "settle"),
            ("spherule still a -o b.png --zoom 2", "-- --zoom"),
            ("spherule convert a -o b --max-eror -1", "-- -"),
        ] {
            let text = message(line);
            assert!(!text.contains(useless), "{line}: {text}");
        }
    }
}
