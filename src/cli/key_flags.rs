//! Options that set a key of the manifest, made from the declarations of the keys.

use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::str::FromStr;

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use spherule_formats::native::Encoding;
use toml::Value;

use super::CliError;
use super::numbers::{number, seconds, whole};
use super::paths::path_as_typed;
use super::progress::mode_parser;
use crate::manifest::{FlagKind, KeyFlag, Override, key_flags, nearest};

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
        let at = self.given.iter().position(|(flag, _)| flag.flag.name == name)?;
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
        Ok(Self { given: given.collect() })
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

/// The value of an option that was given without one, if it may be.
const fn usual_value(kind: FlagKind) -> Option<&'static str> {
    match kind {
        FlagKind::SwitchOrText(usual) | FlagKind::SwitchOrNumberOrText(usual) => Some(usual),
        _ => None,
    }
}

/// `arguments` with a `=` between options that need no value and the values that follow them. What follows is a value if
/// it is one of the words of the option, or similar to one and no file, or a number if the option takes numbers.
pub(super) fn with_equals(arguments: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let flags = key_flags();
    let option = |argument: &OsString| {
        let name = argument.to_str()?.strip_prefix("--")?;
        let flag = flags.iter().find(|flag| flag.flag.name == name)?;
        usual_value(flag.kind).is_some().then_some(flag)
    };
    // Join a value to the option before it, up to `--`
    let mut joined: Vec<OsString> = Vec::new();
    let mut has_options = true;
    for argument in arguments {
        has_options &= argument != "--";
        let flag = joined.last().filter(|_| has_options).and_then(option);
        if let (Some(flag), Some(last)) = (flag, joined.last_mut())
            && argument.to_str().is_some_and(|text| is_value(text, flag))
        {
            last.push("=");
            last.push(argument);
        } else {
            joined.push(argument);
        }
    }
    joined
}

fn is_value(text: &str, flag: &KeyFlag) -> bool {
    let takes_numbers = matches!(flag.kind, FlagKind::SwitchOrNumberOrText(_));
    flag.words.contains(&text)
        || takes_numbers && text.parse::<f64>().is_ok()
        || nearest(text, &flag.words).is_some() && !Path::new(text).exists()
}

/// Any text, with words that shells complete. The words are checked with the manifest.
#[derive(Debug, Clone)]
pub(super) struct KnownWords(pub(super) Vec<&'static str>);

impl TypedValueParser for KnownWords {
    type Value = String;

    fn parse_ref(
        &self,
        command: &Command,
        argument: Option<&Arg>,
        value: &OsStr,
    ) -> Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.0.iter().map(PossibleValue::new)))
    }
}

/// Encodings of native frames, which shells complete.
pub(super) fn encodings() -> impl TypedValueParser<Value = Encoding> {
    let names = Encoding::ALL.map(Encoding::name);
    KnownWords(names.to_vec()).try_map(|name| name.parse::<Encoding>())
}

/// The option of a key.
fn argument(key: &KeyFlag) -> Arg {
    // Write its help; an option that may stand without a value shows no default
    let is_switch = key.kind == FlagKind::Switch;
    let needs_value = !is_switch && usual_value(key.kind).is_none();
    let shown_default = key.default.as_ref().filter(|_| needs_value);
    let default = shown_default.map(|default| format!(" [default: {default}]"));
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
    with_parser(argument.value_name(key.flag.value_name), key)
        .hide_possible_values(key.flag.name != "progress")
        .allow_negative_numbers(!matches!(
            key.kind,
            FlagKind::Text(_) | FlagKind::List | FlagKind::Integers | FlagKind::Numbers
        ))
}

/// The argument with the parser of values of this kind.
fn with_parser(argument: Arg, key: &KeyFlag) -> Arg {
    match key.kind {
        FlagKind::Integer => argument.value_parser(whole),
        FlagKind::Seconds => argument.value_parser(seconds),
        FlagKind::Number => argument.value_parser(number),
        FlagKind::List => argument.value_delimiter(',').action(ArgAction::Append),
        // These names are explained in the help.
        FlagKind::Text(_) if key.flag.name == "progress" => {
            argument.value_parser(mode_parser().map(|mode| mode.name().to_owned()))
        }
        FlagKind::Text(may_begin_with_hyphen) => {
            let argument = argument.allow_hyphen_values(may_begin_with_hyphen);
            if key.words.is_empty() {
                argument
            } else {
                argument.value_parser(KnownWords(key.words.clone()))
            }
        }
        // With `=`, so that an argument that follows is not taken as the value; see `with_equals`
        FlagKind::SwitchOrText(usual) | FlagKind::SwitchOrNumberOrText(usual) => argument
            .num_args(0..=1)
            .require_equals(true)
            .default_missing_value(usual)
            .value_parser(KnownWords(key.words.clone())),
        FlagKind::Integers | FlagKind::Numbers => argument.allow_hyphen_values(true),
        FlagKind::Toml => argument.value_parser(KnownWords(key.words.clone())),
        FlagKind::NumberOrText if !key.words.is_empty() => {
            argument.value_parser(KnownWords(key.words.clone()))
        }
        FlagKind::NumberOrText | FlagKind::Switch => argument,
    }
}

/// The value that was given; of a switch, the opposite of the default.
fn value(key: &KeyFlag, matches: &ArgMatches) -> Option<Value> {
    let name = key.flag.name;
    let text = || matches.get_one::<String>(name).cloned();
    // Read the value by the kind of the key; texts that are not of the kind are refused with the manifest
    match key.kind {
        FlagKind::Switch => {
            let usual = key.default.as_deref() == Some("true");
            matches.get_flag(name).then(|| Value::from(!usual))
        }
        FlagKind::Integer => matches.get_one::<i64>(name).map(|v| Value::from(*v)),
        FlagKind::Number | FlagKind::Seconds => {
            matches.get_one::<f64>(name).map(|v| Value::from(*v))
        }
        FlagKind::Text(_) => text().map(Value::from),
        FlagKind::SwitchOrText(_) => text().map(|text| {
            let is_on = text.parse::<bool>().map(Value::from);
            is_on.unwrap_or(Value::from(text))
        }),
        FlagKind::NumberOrText | FlagKind::SwitchOrNumberOrText(_) => text().map(|text| {
            let whole = text.parse::<i64>().map(Value::from);
            let number = whole.or_else(|_| text.parse::<f64>().map(Value::from));
            number.unwrap_or(Value::from(text))
        }),
        FlagKind::Integers => text().map(items::<i64>),
        FlagKind::Numbers => text().map(items::<f64>),
        FlagKind::Toml => text().map(|text| {
            let table = format!("value = {text}").parse::<toml::Table>();
            let value = table.ok().and_then(|mut table| table.remove("value"));
            value.unwrap_or_else(|| Value::from(text))
        }),
        FlagKind::List => {
            let items: Vec<String> = matches.get_many(name)?.cloned().collect();
            Some(Value::from(items))
        }
    }
}

/// The items between the commas of `text`, or else the text.
fn items<T: FromStr + Into<Value>>(text: String) -> Value {
    let items: Result<Vec<T>, _> = text.split(',').map(|item| item.trim().parse::<T>()).collect();
    items.map_or_else(|_| Value::from(text), Value::from)
}

#[cfg(test)]
#[path = "key_flags_tests.rs"]
mod tests;
