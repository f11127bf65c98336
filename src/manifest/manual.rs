//! Generates the manual page of all keys from their declarations.

use std::fmt::Write as _;

use super::list::{Entries, Entry};
use super::{ABOUT, Manifest};

const INTRODUCTION: &str = "\
`spherule init INPUT > job.toml` writes a manifest with every key and its default. `--set image.width=1280` sets a key
on the command line; this works for every key. The column \"Option\" shows which keys also have an option of their own.
`spherule schema` prints a JSON schema of the manifest for editors.

Keys that do not change images may change between runs of a job. If any other key has changed, the job does not resume
unless you give `--force` or `--keep-done`. [Adding a manifest key](adding-a-manifest-key.md) explains how to add a key.
";

/// The page in Markdown.
fn manual() -> String {
    let entries = Manifest::examples().entries();
    let mut page = format!(
        "<!-- Generated from src/manifest: {COMMAND} -->\n\n# Manifest\n\n{ABOUT}\n\n{INTRODUCTION}"
    );
    let mut tables: Vec<&[Entry]> = tables(&entries).collect();
    // A list follows the table that contains it, as in the file.
    tables.sort_by_key(|table| table[0].section.split('.').next() == Some("light"));
    for table in tables {
        let _ = write!(
            page,
            "\n## {}\n\n{}.\n\n{HEADINGS}",
            title(table),
            table[0].about
        );
        for entry in table {
            page += &row(entry);
        }
    }
    page
}

const HEADINGS: &str = "\
| Key | Type | Range | Default | Option | Changes images | Meaning |
|---|---|---|---|---|---|---|
";

fn tables(entries: &Entries) -> impl Iterator<Item = &[Entry]> {
    entries.list().chunk_by(|a, b| a.section == b.section)
}

/// `[image]`, or `[[light]]` with its type.
fn title(table: &[Entry]) -> String {
    let Some((list, _)) = table[0].section.rsplit_once('.') else {
        return format!("`[{}]`", table[0].section);
    };
    match table.iter().find(|entry| entry.name() == "type") {
        Some(kind) => format!("`[[{list}]]` with `type = {}`", kind.sample()),
        None => format!("`[[{list}]]`"),
    }
}

fn row(entry: &Entry) -> String {
    let key = &entry.declared;
    let range = key.range();
    let kind = entry.kind.replacen(&range, "", 1);
    let kind = kind.split(", such as ").next().unwrap_or_default();
    let kind = match key.word {
        Some(word) => format!("{kind}, or `\"{word}\"`"),
        None => kind.to_owned(),
    };
    let default = match (key.required, &entry.value, key.unset) {
        (Some(_), ..) => "required".to_owned(),
        (None, Some(value), _) => format!("`{value}`"),
        (None, None, Some(unset)) => unset.to_owned(),
        (None, None, None) => "-".to_owned(),
    };
    let flag = key.flag.map(|flag| format!("`--{}`", flag.name));
    let meaning = [vec![key.comment()], key.details()].concat().join(". ");
    let cells = [
        format!("`{}`", entry.name()),
        kind,
        range.trim().to_owned(),
        default,
        flag.unwrap_or_default(),
        key.affects.text().to_owned(),
        meaning,
    ];
    let cells = cells.map(|cell| cell.replace('|', "\\|"));
    format!("| {} |\n", cells.join(" | "))
}

/// The command that generates the page.
const COMMAND: &str = "cargo test --lib manual::tests::write -- --ignored";

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    use super::*;

    fn file() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/manual/manifest.md")
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
