//! Options that set a key of the manifest, made from the declarations of the keys.

use clap::builder::EnumValueParser;
use clap::builder::TypedValueParser as _;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use toml::Value;

use super::CliError;
use super::numbers::{number, seconds, whole};
use super::paths::path_as_typed;
use crate::manifest::{FlagKind, KeyFlag, Override, ProgressMode, key_flags};

/// Headings of the help, in this order.
const HEADINGS: [&str; 6] = ["Input", "Camera", "Image", "Look", "Output", "Job"];

/// Keys whose values are paths, relative to where they are typed.
const PATHS: [&str; 3] = ["input.topology", "output.path", "job.stop_file"];

/// The options that were given, with their values.
#[derive(Debug)]
pub(super) struct KeyFlags {
    given: Vec<(KeyFlag, Value)>,
}

impl KeyFlags {
    /// Removes the option `name` and returns its value.
    pub(super) fn take(&mut self, name: &str) -> Option<String> {
        let at = self
            .given
            .iter()
            .position(|(flag, _)| flag.flag.name == name)?;
        let (_, value) = self.given.swap_remove(at);
        value.as_str().map(str::to_owned)
    }

    /// Adds the given options; `from_file` if they replace values of a manifest from a file.
    pub(super) fn add_overrides(
        &self,
        list: &mut Vec<Override>,
        from_file: bool,
    ) -> Result<(), CliError> {
        for (KeyFlag { key, flag, .. }, value) in &self.given {
            let value = match value.as_str().filter(|_| PATHS.contains(&&**key)) {
                Some(path) => Value::from(path_as_typed(path, from_file)?),
                None => value.clone(),
            };
            list.push(over(key, value, &format!("--{}", flag.name))?);
        }
        Ok(())
    }
}

impl Args for KeyFlags {
    fn augment_args(command: Command) -> Command {
        let mut flags = key_flags();
        flags.sort_by_key(|flag| HEADINGS.iter().position(|h| *h == flag.flag.heading));
        command.args(flags.iter().map(argument))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for KeyFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = key_flags().into_iter().filter_map(|flag| {
            let value = value(&flag, matches)?;
            Some((flag, value))
        });
        Ok(Self {
            given: given.collect(),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Sets `key`; messages call it `shown`.
pub(super) fn over(
    key: &str,
    value: impl Into<toml::Value>,
    shown: &str,
) -> Result<Override, CliError> {
    Override::new(key, value, shown).map_err(|e| CliError::other(e.to_string()))
}

fn argument(key: &KeyFlag) -> Arg {
    let is_switch = key.kind == FlagKind::Switch;
    let needs_value = !is_switch && !matches!(key.kind, FlagKind::SwitchOrText(_));
    let default = key.default.as_ref().filter(|_| needs_value);
    let default = default.map(|default| format!(" [default: {default}]"));
    let help = format!("{}{}", key.help, default.unwrap_or_default());
    let mut argument = Arg::new(key.flag.name)
        .long(key.flag.name)
        .help_heading(key.flag.heading)
        .help(help.clone());
    if !key.details.is_empty() {
        argument = argument.long_help(format!("{help}\n\n{}", key.details.join("\n\n")));
    }
    if key.flag.name == "output" {
        argument = argument.short('o');
    }
    if is_switch {
        return argument.action(ArgAction::SetTrue);
    }
    argument = argument.value_name(key.flag.value_name);
    match key.kind {
        FlagKind::Integer => argument.value_parser(whole),
        FlagKind::Seconds => argument.value_parser(seconds),
        FlagKind::Number => argument.value_parser(number),
        FlagKind::List => argument.value_delimiter(',').action(ArgAction::Append),
        // These names are explained in the help.
        FlagKind::Text(_) if key.flag.name == "progress" => {
            let modes = EnumValueParser::<ProgressMode>::new();
            argument.value_parser(modes.map(|mode| mode.name().to_owned()))
        }
        FlagKind::Text(may_begin_with_hyphen) => {
            argument.allow_hyphen_values(may_begin_with_hyphen)
        }
        // With `=`, so that an argument that follows is not taken as the value
        FlagKind::SwitchOrText(usual) => argument
            .num_args(0..=1)
            .require_equals(true)
            .default_missing_value(usual),
        FlagKind::Integers => argument.allow_hyphen_values(true),
        FlagKind::NumberOrText | FlagKind::Switch => argument,
    }
    .allow_negative_numbers(!matches!(
        key.kind,
        FlagKind::Text(_) | FlagKind::List | FlagKind::Integers
    ))
}

/// The value that was given; of a switch, the opposite of the default.
fn value(key: &KeyFlag, matches: &ArgMatches) -> Option<Value> {
    let name = key.flag.name;
    let text = || matches.get_one::<String>(name).cloned();
    match key.kind {
        FlagKind::Switch => {
            let usual = key.default.as_deref() == Some("true");
            matches.get_flag(name).then(|| Value::from(!usual))
        }
        FlagKind::Integer => matches.get_one::<i64>(name).map(|v| Value::from(*v)),
        FlagKind::Number | FlagKind::Seconds => {
            matches.get_one::<f64>(name).map(|v| Value::from(*v))
        }
        FlagKind::Text(_) | FlagKind::SwitchOrText(_) => text().map(Value::from),
        FlagKind::NumberOrText => text().map(|text| {
            let whole = text.parse::<i64>().map(Value::from);
            let number = whole.or_else(|_| text.parse::<f64>().map(Value::from));
            number.unwrap_or(Value::from(text))
        }),
        FlagKind::Integers => text().map(|text| {
            let items = text.split(',').map(|item| item.trim().parse::<i64>());
            let items: Result<Vec<i64>, _> = items.collect();
            items.map_or_else(|_| Value::from(text), Value::from)
        }),
        FlagKind::List => {
            let items: Vec<String> = matches.get_many(name)?.cloned().collect();
            Some(Value::from(items))
        }
    }
}

#[cfg(test)]
#[path = "key_flags_tests.rs"]
mod tests;
