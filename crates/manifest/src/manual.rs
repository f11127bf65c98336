//! Generates the manual page of all keys from their declarations.

use std::fmt::Write as _;

use super::list::{Entries, Entry};
use super::{ABOUT, Manifest};

const INTRODUCTION: &str = "\
`spherule init INPUT > job.toml` writes a manifest with every key and its default. `--set image.width=1280` sets a key
on the command line; this works for every key. Frequent keys also have an option of their own.
`spherule schema` prints a JSON schema of the manifest for editors.

Where a value is a colour, it is linear RGB, or sRGB as a name of CSS (\"steelblue\"), `\"#4682b4\"`, `\"#48b\"` or integers
with a number above 1 (`[70, 130, 180]`). All of them are stored as linear RGB.

Keys that do not change images may change between runs of a job. If any other key has changed, the job does not resume
unless you give `--force` or `--keep-done`. [Adding a manifest key](adding-a-manifest-key.md) explains how to add a key.
";

/// The page in Markdown.
fn manual() -> String {
    let entries = Manifest::examples().entries();
    let mut page = format!(
        "<!-- Generated from crates/manifest: {COMMAND} -->\n\n# Manifest\n\n{ABOUT}\n\n{INTRODUCTION}"
    );
    let mut tables: Vec<&[Entry]> = tables(&entries).collect();
    // A list follows the table that contains it, as in the file.
    let is_list = |table: &&[Entry]| {
        matches!(
            table[0].section.split('.').next(),
            Some("style" | "clip" | "light" | "mesh" | "arrows" | "overlay")
        )
    };
    tables.sort_by_key(is_list);
    // Describe each table and its keys
    for table in tables {
        let about = match &*table[0].about {
            "" => "It stands before all tables",
            about => about,
        };
        let _ = write!(page, "\n## {}\n\n{about}.\n", title(table));
        for entry in table {
            page += &section(entry);
        }
    }
    page
}

fn tables(entries: &Entries) -> impl Iterator<Item = &[Entry]> {
    entries.list().chunk_by(|a, b| a.section == b.section)
}

/// `[image]`, or `[[light]]` with its type.
fn title(table: &[Entry]) -> String {
    if table[0].section.is_empty() {
        return "Look".to_owned();
    }
    let Some((list, _)) = table[0].section.rsplit_once('.') else {
        return format!("`[{}]`", table[0].section);
    };
    match table.iter().find(|entry| entry.name() == "type") {
        Some(kind) if matches!(list, "clip" | "light" | "overlay") => {
            format!("`[[{list}]]` with `type = {}`", kind.sample())
        }
        _ => format!("`[[{list}]]`"),
    }
}

/// A heading, what the key means, and its properties.
fn section(entry: &Entry) -> String {
    let key = &entry.declared;
    let mut properties = vec![value(entry), default(entry)];
    if let Some(flag) = key.flag {
        properties.push(format!("Option: `--{}`.", flag.name));
    }
    properties.push(key.affects.text().to_owned());
    let meaning = [vec![key.comment()], key.details()].concat().join(". ");
    let end = if meaning.ends_with(['.', ':']) { "" } else { "." };
    let heading = entry.name();
    let meaning = wrapped(&format!("{meaning}{end}"));
    let properties = wrapped(&properties.join(" "));
    format!("\n### `{heading}`\n\n{meaning}\n{properties}")
}

/// The kind of value and its range.
fn value(entry: &Entry) -> String {
    let range = entry.declared.range();
    let without_range = entry.kind.replacen(&range, "", 1);
    let kind = without_range.split(", such as ").next().unwrap_or_default();
    let known = entry.declared.word;
    let word = known.map_or_else(String::new, |word| format!(", or `\"{word}\"`"));
    format!("Value: {kind}{range}{word}.")
}

fn default(entry: &Entry) -> String {
    let key = &entry.declared;
    match (key.required, &entry.value, key.unset) {
        (Some(_), ..) => "Required.".to_owned(),
        (None, Some(value), _) => format!("Default: `{value}`."),
        (None, None, Some(unset)) => format!("Default: {unset}."),
        (None, None, None) => "No default.".to_owned(),
    }
}

/// The paragraph `text` in lines of at most 120 characters.
fn wrapped(text: &str) -> String {
    let mut lines = String::new();
    let mut column = 0;
    for word in text.split_whitespace() {
        let length = word.chars().count();
        if column > 0 && column + 1 + length > LINE {
            lines.push('\n');
            column = 0;
        } else if column > 0 {
            lines.push(' ');
            column += 1;
        }
        lines += word;
        column += length;
    }
    lines.push('\n');
    lines
}

/// Longest line in characters.
const LINE: usize = 120;

/// The command that generates the page.
const COMMAND: &str = "cargo test -p spherule-manifest --lib manual::tests::write -- --ignored";

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    use super::*;

    fn file() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/manual/manifest.md")
    }

    #[test]
    fn the_page_in_the_repository_is_up_to_date() {
        let page = fs::read_to_string(file()).unwrap_or_default();
        assert_eq!(page, manual(), "after a change: {COMMAND}");
    }

    #[test]
    #[ignore = "writes the page"]
    fn write() {
        fs::write(file(), manual()).unwrap();
    }
}
