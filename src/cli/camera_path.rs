//! `--camera-path`: keyframes of the camera from a JSON file, as `[[camera.key]]`.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::CliError;

/// Greatest length of the file, bytes: more than 100,000 keyframes.
const MAX_LEN: u64 = 32 << 20;

/// The keyframes in the file `path`: a list of objects with the keys of `[[camera.key]]`, or an object with such a list
/// as `keys`. Their values are checked with the manifest.
///
/// # Errors
/// The file cannot be read, is no JSON, or has no such list.
pub(super) fn camera_keys(path: &Path) -> Result<toml::Value, CliError> {
    let wrong = |what: &str| {
        let file = path.display();
        CliError::other(format!(
            "--camera-path {file}: {what}; it must have a list of keyframes, such as \
             [{{ \"frame\": 1, \"eye\": [0, -9, 3], \"look_at\": [0, 0, 1], \"fov\": 45 }}]"
        ))
    };
    // Read the file
    let file = File::open(path).map_err(CliError::io(path))?;
    let mut text = Vec::new();
    let read = file.take(MAX_LEN + 1).read_to_end(&mut text);
    if read.map_err(CliError::io(path))? as u64 > MAX_LEN {
        return Err(wrong("the file is longer than 32 MiB"));
    }
    let parsed: serde_json::Value =
        serde_json::from_slice(&text).map_err(|error| wrong(&format!("no JSON: {error}")))?;
    // Take the list
    let list = match parsed {
        serde_json::Value::Object(mut object) => object.remove("keys"),
        other => Some(other),
    };
    let list = list.filter(|list| list.as_array().is_some_and(|keys| !keys.is_empty()));
    let list = list.ok_or_else(|| wrong("no keyframes"))?;
    toml::Value::try_from(list).map_err(|error| wrong(&error.to_string()))
}
