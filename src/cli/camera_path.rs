//! `--camera-path`: keyframes of the camera from a JSON file, as `[[camera.key]]`.

use std::path::Path;

use spherule_jobs::read_regular;

use super::CliError;

/// Greatest length of the file, bytes: far more than that of [`MAX_KEYS`].
const MAX_LEN: u64 = 8 << 20;

/// Greatest number of keyframes. Each takes about 11 kB until the job has started, and the camera moves smoothly
/// between those that are farther apart than one frame.
const MAX_KEYS: usize = 20_000;

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
    let text = read_regular(path, MAX_LEN).map_err(CliError::io(path))?;
    let parsed: serde_json::Value =
        serde_json::from_slice(&text).map_err(|error| wrong(&format!("no JSON: {error}")))?;
    // Take the list
    let found = match parsed {
        serde_json::Value::Object(mut object) => object.remove("keys"),
        other => Some(other),
    };
    let list = found
        .filter(|list| list.as_array().is_some_and(|keys| !keys.is_empty()))
        .ok_or_else(|| wrong("no keyframes"))?;
    let count = list.as_array().map_or(0, Vec::len);
    if count > MAX_KEYS {
        return Err(CliError::other(format!(
            "--camera-path {}: {count} keyframes, but at most {MAX_KEYS} are possible; leave out some of them",
            path.display()
        )));
    }
    toml::Value::try_from(list).map_err(|error| wrong(&error.to_string()))
}
