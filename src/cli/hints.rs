//! Hints for options that a command does not have.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error};

use super::guesses::hints_for;
use crate::manifest::{keys_called, nearest};

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
    let typed = texts(&error, ContextKind::InvalidArg);
    let hint = typed.first().and_then(|typed| hint(typed, command));
    let similar = texts(&error, ContextKind::SuggestedArg);
    if let Some(similar) = similar.first() {
        let option = similar.split(['=', ' ']).next().unwrap_or_default();
        let is_near = |typed: &String| {
            nearest(typed.trim_start_matches('-'), &[option.trim_start_matches('-')]).is_some()
        };
        if hint.is_none() && !is_hidden(command, similar) && typed.first().is_some_and(is_near) {
            return error;
        }
        error.remove(ContextKind::SuggestedArg);
    }
    // An unknown option is rarely meant as a file name
    error.remove(ContextKind::Suggested);
    if let Some(hint) = hint {
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
    let name = typed.trim_start_matches('-');
    let hints = hints_for(name).filter(|hint| is_possible(hint, command));
    let (options, texts): (Vec<&str>, Vec<&str>) = hints.partition(|hint| hint.starts_with("--"));
    if !options.is_empty() {
        return Some(format!("try '{}'", options.join("' or '")));
    }
    if let Some(text) = texts.first() {
        return Some(text.replace("COMMAND", command.get_name()));
    }
    if name.len() < 2 || !has_option(command, "set") {
        return None;
    }
    let options: Vec<String> =
        keys_called(name).iter().map(|key| format!("'--set {key}=VALUE'")).collect();
    (!options.is_empty())
        .then(|| format!("a key of the manifest has this name: {}", options.join(" or ")))
}

/// Whether the help of `command` lists the option `name`.
fn has_option(command: &Command, name: &str) -> bool {
    let mut all = command.get_arguments();
    all.any(|arg| arg.get_long() == Some(name) && !arg.is_hide_set())
}

/// Whether `command` has all options that `hint` names; hints without options are for commands with keys.
fn is_possible(hint: &str, command: &Command) -> bool {
    let mut options = hint.split([' ', '=']).filter_map(|w| w.strip_prefix("--"));
    options.all(|option| has_option(command, option))
        && (hint.starts_with("--") || has_option(command, "set"))
}

#[cfg(test)]
#[path = "hints_tests.rs"]
mod tests;
